#pragma once

#include <string>

#include <CLI/App.hpp>

namespace dynamic_slam {

// The manual page dynamic_slam(1), for man: the program's subcommands with their arguments, as app knows
// them, and the options of the SLAM.
std::string ManPage(const CLI::App& app);

}  // namespace dynamic_slam
