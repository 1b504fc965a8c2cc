// What is done when the sequence is over, in a rendered room with exact truth.

#include <functional>
#include <memory>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "whole_run.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;

constexpr int kFrames = 150;

// For two seconds somebody hides most of the view, so that the map grows there, on little, at the end.
class FinishTest : public ::testing::Test {
 public:
  FinishTest() {
    for (int i = 0; i < kFrames; ++i) {
      images_.push_back(room_.Frame(i));
      if (i < 60) images_.back().colRange(120, images_.back().cols).setTo(0);
    }
  }

 protected:
  static RoomOptions OneRoom() {
    RoomOptions options;
    options.frames = kFrames;
    options.seed = 3;
    return options;
  }

  // Of all images, by a system that has not finished yet.
  std::unique_ptr<SlamSystem> Track(bool grow_twice) const {
    SystemOptions options;
    options.orb.features = 400;
    options.grow_twice = grow_twice;
    auto system = std::make_unique<SlamSystem>(room_.options().camera, options);
    for (int i = 0; i < kFrames; ++i) system->Process(i / 30.0, images_[static_cast<size_t>(i)]);
    return system;
  }

  const Room room_{OneRoom()};
  std::vector<cv::Mat> images_;
};

TEST_F(FinishTest, OfTwoWaysToGrowTheSteadierStaysAndAnInterruptLeavesTheFirst) {
  const auto once = Track(false), twice = Track(true), interrupted = Track(true);
  int asked = 0, asked_once = 0;
  once->Finish([&asked_once] { return ++asked_once < 0; });
  twice->Finish();
  interrupted->Finish([&] { return ++asked > asked_once + 20; });
  EXPECT_GT(asked, asked_once + 20);

  const double error_once = ApeRmse(room_.truth(), once->FrameTrajectory());
  EXPECT_LT(ApeRmse(room_.truth(), twice->FrameTrajectory()), 0.3 * error_once);
  EXPECT_LT(twice->mapping_report().keyframes_culled, once->mapping_report().keyframes_culled);

  const Trajectory first = once->FrameTrajectory(), left = interrupted->FrameTrajectory();
  ASSERT_EQ(left.size(), first.size());
  for (size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(left[i].timestamp_s, first[i].timestamp_s);
    EXPECT_EQ(left[i].world_from_cam, first[i].world_from_cam);
  }
  EXPECT_EQ(interrupted->mapping_report().keyframes_culled, once->mapping_report().keyframes_culled);
  for (const auto* system : {once.get(), twice.get(), interrupted.get()})
    EXPECT_THAT(system->map().Read()->Validate(), IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
