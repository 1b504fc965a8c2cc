#pragma once

#include <functional>

namespace dynamic_slam {

// Runs a program: prints what it throws as `dynamic_slam` does. Returns its exit code: 0, 2 for what the user
// can put right, else 1.
int RunProgram(const std::function<int()>& program);

}  // namespace dynamic_slam
