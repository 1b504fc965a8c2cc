#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `config`: shows, explains and checks the options of the SLAM. Runs inside app.parse().
void AddConfigCommand(CLI::App& app);

}  // namespace dynamic_slam
