#pragma once

#include <CLI/CLI.hpp>

namespace dynamic_slam {

// dynamic_slam view OUT
void AddViewCommand(CLI::App& app);

}  // namespace dynamic_slam
