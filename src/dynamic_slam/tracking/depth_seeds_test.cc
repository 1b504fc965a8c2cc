#include "dynamic_slam/tracking/depth_seeds.h"

#include <algorithm>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

constexpr double kMedianDepth = 5;  // of points 3 to 7 away

// A camera that goes sideways past points that are no landmarks, 2 cm a frame.
class DepthSeedsTest : public ::testing::Test {
 protected:
  static Rigid3 Pose(int frame) { return SidewaysPose(0.02 * frame); }

  // As tracking does with a frame; returns the landmarks that were planted.
  int Follow(int number, bool is_keyframe, double scale = 1) {
    SyntheticView view = world_.See(Pose(number));
    if (spoil_) spoil_(&view);
    view.frame.cam_from_world.translation *= scale;
    Rigid3 motion = Pose(number) * Pose(number - 1).Inverse();
    motion.translation *= scale;
    seeds_.Follow(motion, scale * kMedianDepth, view.frame);
    if (!is_keyframe) return 0;
    const KeyframeId id = InsertKeyframe(view.frame, &scene_.map);
    scene_.views.push_back(view);
    return seeds_.Plant(id, &scene_.map);
  }

  // Two keyframes, 15 frames apart.
  int FollowFromKeyframeToKeyframe() {
    int planted = 0;
    for (int i = 0; i <= 15; ++i) planted += Follow(i, i % 15 == 0);
    return planted;
  }

  SyntheticWorld world_{600};
  SyntheticMap scene_{&world_};
  DepthSeeds seeds_{world_.camera(), SyntheticWorld::OctaveScales()};
  std::function<void(SyntheticView*)> spoil_;
};

TEST_F(DepthSeedsTest, WhatTwoKeyframesSawBecomesLandmarksWhereItIs) {
  const int planted = FollowFromKeyframeToKeyframe();
  EXPECT_GT(planted, 0.8 * static_cast<double>(scene_.views[0].points.size()));
  std::vector<double> errors;
  int wrong = 0;
  scene_.map.landmarks().ForEach([&](const Landmark& landmark) {
    ASSERT_EQ(landmark.observations().size(), 2u);
    const uint32_t point = scene_.PointOf(landmark.observations()[0]);
    wrong += scene_.PointOf(landmark.observations()[1]) != point;
    errors.push_back((landmark.position() - world_.position(point)).norm() / world_.position(point).norm());
  });
  EXPECT_EQ(wrong, 0);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.03);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.1);
  EXPECT_TRUE(scene_.map.Validate().empty());
}

TEST_F(DepthSeedsTest, OneKeyframeIsNotEnough) {
  for (int i = 1; i < 15; ++i) Follow(i, false);
  EXPECT_EQ(Follow(15, true), 0);
}

TEST_F(DepthSeedsTest, ACameraThatRestsKnowsNoDepth) {
  Follow(0, true);
  const SyntheticView view = world_.See(Pose(0));
  for (int i = 0; i < 30; ++i) seeds_.Follow(Rigid3(), kMedianDepth, view.frame);
  EXPECT_EQ(seeds_.Plant(InsertKeyframe(view.frame, &scene_.map), &scene_.map), 0);
}

TEST_F(DepthSeedsTest, WhatIsLikelyToMoveIsNotFollowed) {
  spoil_ = [](SyntheticView* view) {
    for (const Keypoint& keypoint : view->frame.features.keypoints)
      view->frame.static_probability.push_back(keypoint.x < 320 ? 1.0f : 0.3f);
  };
  const int planted = FollowFromKeyframeToKeyframe();
  EXPECT_GT(planted, 50);
  scene_.map.landmarks().ForEach([&](const Landmark& landmark) {
    for (const Observation& o : landmark.observations())
      EXPECT_LT(scene_.map.keyframes().At(o.keyframe).keypoint(o.keypoint).x, 320);
  });
}

TEST_F(DepthSeedsTest, WhatLeavesItsEpipolarLineIsDropped) {
  int frame = 0;
  spoil_ = [&frame](SyntheticView* view) {  // every other point sinks, 2 px a frame
    for (size_t i = 0; i < view->points.size(); ++i) {
      if (view->points[i] % 2 == 0) continue;
      view->frame.features.keypoints[i].y += static_cast<float>(2 * frame);
    }
    view->frame.grid.Build(view->frame.features, TestCamera().IdealBounds());
    ++frame;
  };
  EXPECT_GT(FollowFromKeyframeToKeyframe(), 100);
  scene_.map.landmarks().ForEach([&](const Landmark& landmark) {
    EXPECT_EQ(scene_.PointOf(landmark.observations()[0]) % 2, 0u) << "it moves";
  });
}

TEST_F(DepthSeedsTest, WhatIsALandmarkByNowIsNotMadeOneAgain) {
  for (int i = 0; i < 15; ++i) Follow(i, i == 0);
  SyntheticView view = world_.See(Pose(15));
  const LandmarkId known = scene_.map.AddLandmark({0, 0, 5}, KeyframeId(0)).id();
  std::fill(view.frame.landmarks.begin(), view.frame.landmarks.end(), known);
  seeds_.Follow(Pose(15) * Pose(14).Inverse(), kMedianDepth, view.frame);
  std::fill(view.frame.landmarks.begin(), view.frame.landmarks.end(), LandmarkId());
  EXPECT_EQ(seeds_.Plant(InsertKeyframe(view.frame, &scene_.map), &scene_.map), 0);
}

TEST_F(DepthSeedsTest, GoesOnWhenTheMapIsScaled) {
  for (int i = 0; i < 8; ++i) Follow(i, i == 0);
  seeds_.Scale(2);
  // The keyframe that saw them first is scaled with the map.
  Keyframe& first = scene_.map.keyframes().At(KeyframeId(0));
  Rigid3 pose = first.cam_from_world();
  pose.translation *= 2;
  first.set_cam_from_world(pose);
  int planted = 0;
  for (int i = 8; i <= 15; ++i) planted += Follow(i, i == 15, 2);
  EXPECT_GT(planted, 100);
  std::vector<double> errors;
  scene_.map.landmarks().ForEach([&](const Landmark& landmark) {
    const Eigen::Vector3d& position = world_.position(scene_.PointOf(landmark.observations()[0]));
    errors.push_back((landmark.position() - 2 * position).norm() / (2 * position.norm()));
  });
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.03);
}

}  // namespace
}  // namespace dynamic_slam
