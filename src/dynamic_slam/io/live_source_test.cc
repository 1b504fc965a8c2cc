#include "dynamic_slam/io/live_source.h"

#include <deque>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/videoio.hpp>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A camera whose fate is written down: an image, or gone until it was opened so often.
class FakeCamera : public ImageGrabber {
 public:
  // images[i]: how many images it gives after it was opened the i-th time; -1: it cannot be opened then, as
  // after the last.
  explicit FakeCamera(std::deque<int> images) : fate_(std::move(images)) {}

  bool Open() override {
    left_ = fate_.empty() ? -1 : fate_.front();
    if (!fate_.empty()) fate_.pop_front();
    return left_ >= 0;
  }
  bool Grab(cv::Mat* image) override {
    if (left_-- <= 0) return false;
    *image = cv::Mat::zeros(4, 6, CV_8UC1);
    return true;
  }

 private:
  std::deque<int> fate_;
  int left_ = 0;
};

class LiveSourceTest : public ::testing::Test {
 protected:
  // An image every 0.1 s.
  std::unique_ptr<FrameSource> Open(std::deque<int> images, FrameSourceOptions options = {}) {
    options.on_event = [this](const std::string& event) { events_.push_back(event); };
    const LiveClock clock{[this] { return now_s_ += 0.1; },
                          [this](double s) {
                            now_s_ += s;
                            ++waits_;
                          }};
    return MakeLiveSource("camera:7", std::make_unique<FakeCamera>(std::move(images)), options, clock);
  }

  static std::vector<double> Stamps(FrameSource* source) {
    std::vector<double> stamps;
    while (const std::optional<SourceImage> image = source->Next()) stamps.push_back(image->timestamp_s);
    return stamps;
  }

  double now_s_ = 1000;
  int waits_ = 0;
  std::vector<std::string> events_;
};

TEST_F(LiveSourceTest, ComesBackAfterItWasGoneAndSaysSo) {
  const auto source = Open({2, -1, -1, 3});
  EXPECT_EQ(source->Layout(), "live");
  EXPECT_TRUE(source->IsLive());
  EXPECT_EQ(source->ImageSize(), cv::Size(6, 4));
  const std::vector<double> stamps = Stamps(source.get());
  ASSERT_EQ(stamps.size(), 5u);
  EXPECT_EQ(stamps[0], 0);
  for (size_t i = 1; i < stamps.size(); ++i) EXPECT_GT(stamps[i], stamps[i - 1]);
  EXPECT_GT(stamps[2] - stamps[1], 2);  // two attempts
  ASSERT_GE(events_.size(), 3u);
  EXPECT_THAT(events_[0], HasSubstr("camera:7: no more images"));
  EXPECT_THAT(events_[1], HasSubstr("found again after"));
}

TEST_F(LiveSourceTest, IsGivenUpAfterAMinute) {
  const auto source = Open({2});
  EXPECT_EQ(Stamps(source.get()).size(), 2u);
  EXPECT_THAT(events_, ElementsAre(HasSubstr("no more images"), HasSubstr("given up")));
  EXPECT_EQ(source->EndReason(), "gave no image for 60 s");
  EXPECT_GT(now_s_, 1060);
  EXPECT_LT(now_s_, 1070);
}

TEST_F(LiveSourceTest, WhatOpensWithoutAnImageIsStillAway) {
  std::deque<int> images(100000, 0);
  images.front() = 2;
  const auto source = Open(images);
  EXPECT_EQ(Stamps(source.get()).size(), 2u);
  EXPECT_THAT(events_, ElementsAre(HasSubstr("no more images"), HasSubstr("given up")));
  EXPECT_GT(now_s_, 1060);
  EXPECT_LT(waits_, 62) << "no more often than once a second";
  EXPECT_GT(waits_, 40);
}

TEST_F(LiveSourceTest, IsGivenUpWhenItIsNotWanted) {
  FrameSourceOptions options;
  options.should_stop = [] { return true; };
  const auto source = Open({2}, options);
  EXPECT_EQ(Stamps(source.get()).size(), 2u);
  EXPECT_EQ(source->EndReason(), "");
  EXPECT_LT(now_s_, 1002);
}

TEST_F(LiveSourceTest, SkipsAndCounts) {
  FrameSourceOptions options;
  options.start = 3;
  options.max_frames = 4;
  const auto source = Open({100}, options);
  EXPECT_EQ(Stamps(source.get()).size(), 4u);
}

TEST_F(LiveSourceTest, WhatCannotBeOpenedIsAnError) {
  EXPECT_THROW(Open({-1}), InputError);
  EXPECT_THROW(Open({0}), InputError);
  for (const char* name : {"camera:", "camera:x", "camera:-1", "camera:987"}) {
    try {
      OpenFrameSource(name);
      FAIL() << name;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("/dev/video0 is camera:0"));
    }
  }
  EXPECT_THROW(OpenFrameSource("rtsp://127.0.0.1:1/nothing"), InputError);
}

TEST(LiveSourceNameTest, TheAddressOfAFilmIsAFilm) {
  const auto file = std::filesystem::path(testing::TempDir()) / "film.avi";
  cv::VideoWriter writer(file.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20, {64, 48});
  if (!writer.isOpened()) GTEST_SKIP() << "OpenCV cannot write videos";
  for (int i = 0; i < 12; ++i) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(20 * i)));
  writer.release();
  const auto source = OpenFrameSource("file://" + file.string());
  EXPECT_FALSE(source->IsLive());
  EXPECT_EQ(source->FrameCount(), 12u);
  int images = 0;
  for (; const auto image = source->Next(); ++images) EXPECT_NEAR(image->timestamp_s, images / 20.0, 1e-6);
  EXPECT_EQ(images, 12);
  std::filesystem::remove(file);
}

TEST(LiveSourceNameTest, IsToldFromFiles) {
  for (const char* name : {"camera:0", "rtsp://10.0.0.1/stream", "http://host:8080/video"}) {
    EXPECT_TRUE(IsLiveSource(name)) << name;
  }
  for (const char* name : {"video.mp4", "/data/camera", "camera0", "a:b"})
    EXPECT_FALSE(IsLiveSource(name)) << name;
}

TEST(LiveSourceNameTest, EachRunHasAFolderOfItsOwn) {
  const auto parent = std::filesystem::path(testing::TempDir()) / "live_folders";
  std::filesystem::remove_all(parent);
  EXPECT_EQ(LiveFolder(parent, "camera:0"), parent / "camera_0");
  std::filesystem::create_directories(parent / "camera_0");
  EXPECT_EQ(LiveFolder(parent, "camera:0"), parent / "camera_0") << "it is empty";
  std::filesystem::create_directories(parent / "camera_0" / "results");
  EXPECT_EQ(LiveFolder(parent, "camera:0"), parent / "camera_0_2");
  EXPECT_EQ(LiveFolder(parent, "camera:1"), parent / "camera_1");
  EXPECT_EQ(LiveFolder(parent, "rtsp://me:s/e@cret@10.0.0.1:554/a/?token=b").parent_path(), parent);
  EXPECT_EQ(LiveFolder(parent, "rtsp://me:secret@10.0.0.1:554/a/b?token=c"), parent / "10.0.0.1_554_a_b");
  EXPECT_EQ(LiveFolder(parent, "http://../.."), parent / "live");
  std::filesystem::remove_all(parent);
}

TEST(LiveSourceNameTest, IsShownWithoutThePassword) {
  EXPECT_EQ(WithoutPassword("rtsp://me:secret@10.0.0.1:554/a"), "rtsp://me:***@10.0.0.1:554/a");
  EXPECT_EQ(WithoutPassword("rtsp://me:s@cret@host/a@b"), "rtsp://me:***@host/a@b");
  for (const char* name : {"rtsp://10.0.0.1:554/a", "rtsp://me@host/a:b", "http://host/a:b@c", "camera:0",
                           "video:1@2.mp4", "rtsp://"}) {
    EXPECT_EQ(WithoutPassword(name), name);
  }
  try {
    OpenFrameSource("rtsp://me:secret@127.0.0.1:1/nothing");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), Not(HasSubstr("secret")));
  }
}

}  // namespace
}  // namespace dynamic_slam
