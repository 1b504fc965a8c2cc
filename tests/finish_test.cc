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

TEST(FinishLensTest, AMapThatDoubtsTheLensIsNotAlignedToItAndSaysSo) {
  RoomOptions room_options;
  room_options.frames = 60;
  const Room room(room_options);
  std::vector<cv::Mat> images;
  for (int i = 0; i < room_options.frames; ++i) images.push_back(room.Frame(i));
  Camera barrel = room_options.camera;
  barrel.k1 = 0.08;  // the room's has none: wrong by ten pixels in the corners
  const auto run = [&images](const Camera& camera, bool align) {
    SystemOptions options;
    options.orb.features = 600;
    options.align_sightings = align;
    ImageSource source(images);
    return RunAll(source, camera, options);
  };
  const WholeRun right = run(room_options.camera, true);
  EXPECT_FALSE(right.system->LensDoubt().has_value());
  const WholeRun wrong = run(barrel, true), as_it_is = run(barrel, false);
  ASSERT_TRUE(wrong.system->LensDoubt().has_value());
  EXPECT_LT(wrong.system->LensDoubt()->k1, 0.06);
  ASSERT_TRUE(wrong.summary.lens_doubt.has_value());
  EXPECT_FALSE(as_it_is.summary.lens_doubt.has_value());

  const Trajectory path = wrong.system->FrameTrajectory(), plain = as_it_is.system->FrameTrajectory();
  ASSERT_EQ(path.size(), plain.size());
  ASSERT_GT(path.size(), 40u);
  for (size_t i = 0; i < path.size(); ++i) EXPECT_EQ(path[i].world_from_cam, plain[i].world_from_cam);
}

}  // namespace
}  // namespace dynamic_slam
