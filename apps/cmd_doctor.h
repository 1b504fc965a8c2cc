#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `doctor`: whether the machine, the files and a clip are fit for a run. Runs inside app.parse().
void AddDoctorCommand(CLI::App& app);

}  // namespace dynamic_slam
