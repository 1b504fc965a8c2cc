#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `calibrate`: a camera file from images of a chessboard. Runs inside app.parse().
void AddCalibrateCommand(CLI::App& app);

}  // namespace dynamic_slam
