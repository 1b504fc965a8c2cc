#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `eval ape|rpe GT EST`: judges a trajectory file against ground truth. Runs inside app.parse().
void AddEvalCommand(CLI::App& app);

}  // namespace dynamic_slam
