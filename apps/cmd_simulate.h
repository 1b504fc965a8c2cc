#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `simulate room`: renders a sequence with exact truth. Runs inside app.parse().
void AddSimulateCommand(CLI::App& app);

}  // namespace dynamic_slam
