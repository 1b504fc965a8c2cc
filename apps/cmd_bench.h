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

// Adds the paper's experiments on rendered scenes: `bench recall`, detections before and after compensation
// (4.1), `bench interference`, people always in view (4.2), and `bench init`, starts before somebody who
// moves (4.3).
void AddRecallCommand(CLI::App* bench, int* exit_code);
void AddInterferenceCommand(CLI::App* bench, int* exit_code);
void AddInitCommand(CLI::App* bench, int* exit_code);

// Adds the paper's tables: `bench tum` (1 to 4), `bench kitti` (5 to 7), and `bench profiles SOURCE` (8).
void AddPaperCommands(CLI::App* bench, int* exit_code);
void AddProfilesCommand(CLI::App* bench, int* exit_code);

}  // namespace dynamic_slam
