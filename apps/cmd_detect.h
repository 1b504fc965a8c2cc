#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `detect SOURCE`: a detector over a sequence. Runs inside app.parse().
void AddDetectCommand(CLI::App& app, int* exit_code);

}  // namespace dynamic_slam
