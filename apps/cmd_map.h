#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `map info|validate|export FILE`: what `run --save-map` wrote. Runs inside app.parse().
void AddMapCommand(CLI::App& app);

}  // namespace dynamic_slam
