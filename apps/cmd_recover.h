#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `recover OUT`: results of a run that was killed. Runs inside app.parse().
void AddRecoverCommand(CLI::App& app);

}  // namespace dynamic_slam
