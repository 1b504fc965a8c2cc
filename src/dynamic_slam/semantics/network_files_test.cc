#include "dynamic_slam/semantics/network_files.h"

#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/test_folder.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

class NetworkFilesTest : public FolderTest {
 protected:
  // The environment is this test's own.
  void SetUp() override {
    unsetenv("DYNAMIC_SLAM_MODELS");
    unsetenv("XDG_DATA_HOME");
    setenv("HOME", (folder_ / "home").c_str(), 1);
  }
  DetectorFile Detector(const std::string& sha256 = "") const {
    DetectorFile detector{folder_ / "config" / "mine.yaml", "mine", {}, {"person"}};
    detector.options.model = {"a.onnx", sha256};
    detector.options.config = {"sub/a.cfg", ""};
    return detector;
  }
};

// FIPS 180-2, appendix B, and the empty message.
TEST_F(NetworkFilesTest, Sha256OfKnownMessages) {
  EXPECT_EQ(Sha256(Write("a", "abc")), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(Sha256(Write("b", "")), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(Sha256(Write("c", std::string(1000000, 'a'))),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  EXPECT_THAT(ErrorOf([&] { Sha256(folder_ / "none"); }), testing::HasSubstr("cannot be read"));
}

TEST_F(NetworkFilesTest, FoldersInTheirOrder) {
  EXPECT_THAT(ModelFolders(), testing::ElementsAre(folder_ / "home/.local/share/dynamic_slam/models"));
  setenv("XDG_DATA_HOME", "/data", 1);
  setenv("DYNAMIC_SLAM_MODELS", "/models", 1);
  EXPECT_THAT(ModelFolders("mine"), testing::ElementsAre("mine", "/models", "/data/dynamic_slam/models"));
}

TEST_F(NetworkFilesTest, TheFirstFolderThatHasItWins) {
  const std::vector<fs::path> folders = {folder_ / "one", folder_ / "two"};
  EXPECT_FALSE(FindNetworkFiles(Detector(), folders)[0].found.has_value());
  Write("two/a.onnx", "2");
  Write("two/sub/a.cfg", "2");
  EXPECT_EQ(RequireNetworkFile(Detector(), "model", folders), folder_ / "two/a.onnx");
  EXPECT_EQ(RequireNetworkFile(Detector(), "config", folders), folder_ / "two/sub/a.cfg");
  EXPECT_EQ(RequireNetworkFile(Detector(), "anchors", folders), "");
  Write("one/a.onnx", "1");
  EXPECT_EQ(RequireNetworkFile(Detector(), "model", folders), folder_ / "one/a.onnx");
  Write("config/a.onnx", "0");
  EXPECT_EQ(RequireNetworkFile(Detector(), "model", folders), folder_ / "config/a.onnx");
}

TEST_F(NetworkFilesTest, ChecksumsWhereTheyAreKnown) {
  Write("config/a.onnx", "abc");
  EXPECT_EQ(FindNetworkFiles(Detector(), {})[0].WrongSha256(), "");
  const std::string right = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
  EXPECT_EQ(FindNetworkFiles(Detector(right), {})[0].WrongSha256(), "");
  EXPECT_EQ(FindNetworkFiles(Detector(std::string(64, '0')), {})[0].WrongSha256(), right);
}

}  // namespace
}  // namespace dynamic_slam
