#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace dynamic_slam {

// What the user gave is wrong: a file, an option, a model. The message names the thing (with its line where
// known), the reason and the remedy. Programs print it and exit with code 2.
class InputError : public std::runtime_error {
 public:
  InputError(const std::string& what_is_wrong, const std::string& reason, const std::string& remedy)
      : std::runtime_error(remedy.empty() ? fmt::format("{}: {}", what_is_wrong, reason)
                                          : fmt::format("{}: {}\n  {}", what_is_wrong, reason, remedy)) {}
};

// A bug of ours: an invariant does not hold.
class InternalError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

namespace internal {
[[noreturn]] inline void CheckFailed(const char* file, int line, const char* condition,
                                     const std::string& values) {
  throw InternalError(fmt::format("{}:{}: check failed: {} {}", file, line, condition, values));
}
}  // namespace internal

}  // namespace dynamic_slam

// DS_CHECK(a < b, "a={} b={}", a, b): throws InternalError with the values when the condition is false.
#define DS_CHECK(condition, ...)                                                                         \
  do {                                                                                                   \
    if (!(condition)) [[unlikely]]                                                                       \
      ::dynamic_slam::internal::CheckFailed(__FILE__, __LINE__, #condition,                              \
                                            std::string(__VA_OPT__(fmt::format(__VA_ARGS__))));          \
  } while (false)
