#pragma once

#include <exception>
#include <functional>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "dynamic_slam/base/input_error.h"
#include "run_console.h"

namespace dynamic_slam {

// What a run writes beside its results, frame by frame. When that is not possible any more it ends, with one
// warning, and the run goes on.
class ExtraOutput {
 public:
  // option: that asks for it.
  ExtraOutput(std::string option, const RunConsole& console)
      : option_(std::move(option)), console_(console) {}

  void Try(const std::function<void()>& write) {
    if (failure_ != nullptr) return;
    try {
      write();
    } catch (const InputError& error) {
      failure_ = std::current_exception();
      console_.Say(
          fmt::format("warning: {} ends here, and the run goes on without it: {}", option_, error.what()));
    }
  }

  // What ended it, or null.
  std::exception_ptr failure() const { return failure_; }

 private:
  std::string option_;
  const RunConsole& console_;
  std::exception_ptr failure_;
};

}  // namespace dynamic_slam
