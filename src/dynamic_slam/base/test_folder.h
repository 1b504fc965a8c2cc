#pragma once

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {

// A test with an empty folder of its own.
class FolderTest : public ::testing::Test {
 protected:
  FolderTest() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(::testing::TempDir()) /
              (std::string("dynamic_slam_") + std::to_string(getpid()) + "_" + test->test_suite_name() + "_" +
               test->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~FolderTest() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  // Writes the file and returns its path.
  std::filesystem::path Write(const std::string& name, std::string_view content) const {
    WriteFileAtomically(folder_ / name, content);
    return folder_ / name;
  }

  // The message of the InputError that `call` throws; "" when it throws none.
  static std::string ErrorOf(const std::function<void()>& call) {
    try {
      call();
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }

  std::filesystem::path folder_;
};

// The folder of shared data sets, or nothing.
inline std::filesystem::path SharedData() {
  const char* data = std::getenv("DYNAMIC_SLAM_DATA");
  return data == nullptr ? std::filesystem::path() : std::filesystem::path(data);
}

}  // namespace dynamic_slam
