#pragma once

#include <string>

#include <fmt/format.h>

#include "dynamic_slam/base/input_error.h"

namespace dynamic_slam::internal {

[[noreturn]] inline void CheckFailed(const char* file, int line, const char* condition,
                                     const std::string& values) {
  throw InternalError(fmt::format("{}:{}: check failed: {} {}", file, line, condition, values));
}

}  // namespace dynamic_slam::internal

// DS_CHECK(a < b, "a={} b={}", a, b): throws InternalError with the values when the condition is false.
#define DS_CHECK(condition, ...)                                                                \
  do {                                                                                          \
    if (!(condition)) [[unlikely]]                                                              \
      ::dynamic_slam::internal::CheckFailed(__FILE__, __LINE__, #condition,                     \
                                            std::string(__VA_OPT__(fmt::format(__VA_ARGS__)))); \
  } while (false)
