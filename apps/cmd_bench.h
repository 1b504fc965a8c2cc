#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `bench`, experiments over sequences. Each runs inside app.parse(). exit_code becomes 130 after an
// interrupt.
void AddBenchCommand(CLI::App& app, int* exit_code);

// Adds `bench ablation SOURCE...`: what each part of the treatment of dynamic objects is worth.
void AddAblationCommand(CLI::App* bench, int* exit_code);

// Adds `bench loops SOURCE...`: how well places are known again, and what closing loops is worth.
void AddLoopsCommand(CLI::App* bench, int* exit_code);

// Adds `bench scale SOURCE...`: what time and memory do in a long sequence.
void AddScaleCommand(CLI::App* bench, int* exit_code);

}  // namespace dynamic_slam
