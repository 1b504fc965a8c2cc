#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `models`: the networks that detector files describe, and whether their files are there. Runs inside
// app.parse().
void AddModelsCommand(CLI::App& app);

}  // namespace dynamic_slam
