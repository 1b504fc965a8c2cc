#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `run SOURCE`: the SLAM over a sequence. Runs inside app.parse(). exit_code becomes 130 after an
// interrupt.
void AddRunCommand(CLI::App& app, int* exit_code);

}  // namespace dynamic_slam
