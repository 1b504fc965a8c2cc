#include "program.h"

#include <cstdio>
#include <exception>

#include <fmt/core.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/worker.h"

namespace dynamic_slam {
namespace {

int ExitCode(const std::function<int()>& program) {
  try {
    return program();
  } catch (const InputError& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "internal error: {}\n", error.what());
    return 1;
  }
}

}  // namespace

int RunProgram(const std::function<int()>& program) {
  const int code = ExitCode(program);
  if (Worker::AbandonedCount() > 0) {
    std::fflush(nullptr);
    std::_Exit(code);  // a network that hangs still uses what destructors would take away
  }
  return code;
}

}  // namespace dynamic_slam
