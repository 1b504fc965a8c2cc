#pragma once

#include <CLI/App.hpp>

namespace dynamic_slam {

// Adds `demo`: renders the room, runs on it and judges the result. Runs inside app.parse(). exit_code becomes
// 130 after an interrupt.
void AddDemoCommand(CLI::App& app, int* exit_code);

}  // namespace dynamic_slam
