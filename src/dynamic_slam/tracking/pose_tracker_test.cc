#include "dynamic_slam/tracking/pose_tracker.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

// Two keyframes with landmarks, and a third view to be tracked.
class PoseTrackerTest : public ::testing::Test {
 protected:
  PoseTrackerTest() {
    first_ = scene_.Add(SidewaysPose(0));
    second_ = scene_.Add(SidewaysPose(0.3));
    landmarks_ = scene_.AddLandmarks(0, static_cast<uint32_t>(world_.size()), {first_, second_});
    frame_ = world_.See(true_pose_);
  }

  // The second keyframe as the last frame was.
  Frame LastFrame() const {
    Frame last = scene_.views[1].frame;
    last.landmarks = scene_.map.keyframes().At(second_).landmarks();
    for (size_t i = 0; i < last.landmarks.size(); ++i) {
      if (last.landmarks[i].IsValid())
        last.points[i] = scene_.map.landmarks().At(last.landmarks[i]).position();
    }
    return last;
  }

  void ExpectPose(int inliers, double min_share) const {
    EXPECT_GT(inliers, min_share * landmarks_);
    EXPECT_LT((frame_.frame.cam_from_world.translation - true_pose_.translation).norm(), 0.01);
    EXPECT_LT(RotationAngle(frame_.frame.cam_from_world.rotation, true_pose_.rotation), 0.002);
    int links = 0, wrong = 0;
    for (size_t i = 0; i < frame_.points.size(); ++i) {
      const LandmarkId id = frame_.frame.landmarks[i];
      if (!id.IsValid()) continue;
      ++links;
      wrong += scene_.PointOf(scene_.map.landmarks().At(id).observations()[0]) != frame_.points[i];
    }
    EXPECT_EQ(links, inliers);
    EXPECT_LE(wrong, links / 50);
  }

  SyntheticWorld world_{600};
  SyntheticMap scene_{&world_};
  Rigid3 true_pose_{ExpSo3({0.01, 0.02, 0.01}), {-0.35, 0.02, 0.05}};
  KeyframeId first_, second_;
  int landmarks_ = 0;
  SyntheticView frame_;
  PoseTracker tracker_{world_.camera(), {}, SyntheticWorld::OctaveScales()};
};

TEST_F(PoseTrackerTest, FromTheLastFrame) {
  ExpectPose(tracker_.TrackFromFrame(LastFrame(), SidewaysPose(0.3), 15, &frame_.frame), 0.8);
}

TEST_F(PoseTrackerTest, FromTheLastFrameWithoutAnIdeaThereIsNothing) {
  const Rigid3 wrong(ExpSo3({0, 0.5, 0}), {0, 0, 0});
  EXPECT_LT(tracker_.TrackFromFrame(LastFrame(), wrong, 15, &frame_.frame), 15);
}

TEST_F(PoseTrackerTest, FromAKeyframeWithoutAnIdea) {
  frame_.frame.cam_from_world = Rigid3();
  Random random(1);
  const Keyframe& keyframe = scene_.map.keyframes().At(first_);
  ExpectPose(tracker_.TrackFromKeyframe(scene_.map, keyframe, random, &frame_.frame), 0.7);
}

TEST_F(PoseTrackerTest, AnotherPlaceIsNotTakenForTheKeyframe) {
  Random random(2);
  for (Descriptor& descriptor : frame_.frame.features.descriptors) {
    descriptor = {random.Next(), random.Next(), random.Next(), random.Next()};
  }
  const Keyframe& keyframe = scene_.map.keyframes().At(first_);
  EXPECT_EQ(tracker_.TrackFromKeyframe(scene_.map, keyframe, random, &frame_.frame), 0);
}

TEST_F(PoseTrackerTest, TheLocalMapAddsWhatTheFrameDoesNotHave) {
  Frame last = LastFrame();
  for (size_t i = 0; i < last.landmarks.size(); ++i) {
    if (i % 4 != 0) last.landmarks[i] = LandmarkId();
  }
  const int few = tracker_.TrackFromFrame(last, SidewaysPose(0.3), 15, &frame_.frame);
  ASSERT_GT(few, 20);
  LocalView view;
  LocalViewBuilder().Build(scene_.map, 0, frame_.frame.landmarks, 10, &view);
  std::vector<uint8_t> in_view;
  const int many = tracker_.TrackLocalMap(view, 4, &frame_.frame, &in_view);
  EXPECT_GT(many, 2 * few);
  ExpectPose(many, 0.8);
  ASSERT_EQ(in_view.size(), view.size());
  EXPECT_GE(std::count(in_view.begin(), in_view.end(), 1), many);
  std::vector<LandmarkId> found = frame_.frame.landmarks;
  std::erase(found, LandmarkId());
  std::sort(found.begin(), found.end());
  EXPECT_EQ(std::adjacent_find(found.begin(), found.end()), found.end()) << "each once";
  // What this frame had does not count for the next.
  frame_.frame.ClearLandmarks();
  EXPECT_EQ(tracker_.TrackLocalMap(view, 4, &frame_.frame, &in_view), many);
}

}  // namespace
}  // namespace dynamic_slam
