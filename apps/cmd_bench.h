#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `bench ablation SOURCE...`: what each part of the treatment of dynamic objects is worth. Runs inside
// app.parse(). exit_code becomes 130 after an interrupt.
void AddBenchCommand(CLI::App& app, int* exit_code);

}  // namespace dynamic_slam
