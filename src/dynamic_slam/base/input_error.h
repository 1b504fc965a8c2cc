#pragma once

#include <stdexcept>
#include <string>

#include "dynamic_slam/base/export.h"

namespace dynamic_slam {

// What the user gave is wrong: a file, an option, a model. The message names the thing (with its line where
// known), the reason and the remedy. Programs print it and exit with code 2.
class DYNAMIC_SLAM_API InputError : public std::runtime_error {
 public:
  InputError(const std::string& what_is_wrong, const std::string& reason, const std::string& remedy)
      : std::runtime_error(
            Printable(what_is_wrong + ": " + reason + (remedy.empty() ? "" : "\n  " + remedy))) {}

 private:
  // What is quoted of a file must neither end the message nor command a terminal.
  static std::string Printable(std::string text) {
    for (char& c : text) {
      if ((c >= 0 && c < 0x20 && c != '\n' && c != '\t') || c == 0x7f) c = '?';
    }
    return text;
  }
};

// A bug of ours: an invariant does not hold.
class DYNAMIC_SLAM_API InternalError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

}  // namespace dynamic_slam
