#include "dynamic_slam/tracking/bridge_finder.h"

#include <cmath>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr uint32_t kPoints = 1500;

// A camera that moves sideways, a frame a second. After six it was lost for a moment, and what follows has a
// world and a unit of length of its own: another part of the map, or the same one that drifted.
class BridgeFinderTest : public testing::Test {
 protected:
  static constexpr int kKeyframes = 6;  // of either part

  // The first points look the same to both parts.
  void MakeParts(size_t same_points = kPoints) {
    MakeSide(0, scene_.map.BeginPart());
    world_.Repaint(same_points);
    MakeSide(1, scene_.map.BeginPart());
    scene_.Drift(keyframes_[1], kDrift);
  }

  void MakeSide(int side, PartId part, uint32_t points = kPoints) {
    for (int i = 0; i < kKeyframes; ++i)
      keyframes_[side].push_back(scene_.Add(SidewaysPose(0.1 * (kKeyframes * side + i)), part));
    scene_.AddLandmarks(0, points, keyframes_[side]);
  }

  void LoseFrames(int frames) {
    for (int i = 0; i < frames; ++i) world_.See(SidewaysPose(0));
  }

  KnownPoses Known() const {
    std::vector<AnchoredPose> poses;
    scene_.map.keyframes().ForEach([&](const Keyframe& keyframe) {
      poses.push_back({keyframe.timestamp_s(), keyframe.id(), Rigid3()});
    });
    return KnownPoses(poses, &scene_.shared_map);
  }

  std::vector<BridgeFinder::Border> Borders() { return Finder().Borders(Known()); }

  Bridge Find() {
    const KnownPoses known = Known();
    const std::vector<BridgeFinder::Border> borders = Borders();
    EXPECT_THAT(borders, SizeIs(1));
    return Finder().Find(known, borders.at(0));
  }

  BridgeFinder Finder() { return {world_.camera(), TrackerOptions(), &scene_.shared_map}; }

  void ExpectKDrift(const Bridge& bridge) {
    const Sim3 found = SecondFromFirst(bridge);
    EXPECT_NEAR(found.scale, kDrift.scale, 0.02);
    EXPECT_LT(found.rotation.angularDistance(kDrift.rotation), 0.005);
    EXPECT_LT((found.translation - kDrift.translation).norm(), 0.05);
  }

  // The second part's world from the first one's.
  Sim3 SecondFromFirst(const Bridge& bridge) const {
    const Keyframe& keyframe = scene_.map.keyframes().At(bridge.keyframe);
    const Keyframe& neighbour = scene_.map.keyframes().At(bridge.neighbour);
    const Sim3 here_from_there = ToSim3(keyframe.cam_from_world()).Inverse() *
                                 bridge.keyframe_from_neighbour * ToSim3(neighbour.cam_from_world());
    return keyframe.timestamp_s() > neighbour.timestamp_s() ? here_from_there : here_from_there.Inverse();
  }

  SyntheticWorld world_{kPoints};
  SyntheticMap scene_{&world_};
  std::vector<KeyframeId> keyframes_[2];
};

TEST_F(BridgeFinderTest, FindsHowThePartsFitTogether) {
  MakeParts();
  const Bridge bridge = Find();
  ASSERT_THAT(bridge.reason, IsEmpty());
  EXPECT_GT(bridge.common, 100);
  EXPECT_GT(bridge.links.size(), 100u);
  EXPECT_NE(scene_.map.PartOf(bridge.keyframe), scene_.map.PartOf(bridge.neighbour));
  for (const auto& [keypoint, landmark] : bridge.links)
    EXPECT_EQ(scene_.map.PartOf(scene_.map.landmarks().At(landmark)), scene_.map.PartOf(bridge.neighbour));
  ExpectKDrift(bridge);
}

TEST_F(BridgeFinderTest, FindsHowOnePartDriftedWhereNothingHeldItTogether) {
  const PartId part = scene_.map.BeginPart();
  MakeSide(0, part);
  MakeSide(1, part);
  EXPECT_LT(Find().drift_px, 1) << "not yet";
  scene_.Drift(keyframes_[1], kDrift);
  const Bridge bridge = Find();
  ASSERT_THAT(bridge.reason, IsEmpty());
  EXPECT_GT(bridge.drift_px, 20);
  ExpectKDrift(bridge);
}

TEST_F(BridgeFinderTest, WhatSharesLandmarksIsNoBorder) {
  const PartId part = scene_.map.BeginPart();
  MakeSide(0, part, kPoints / 2);
  MakeSide(1, part, kPoints / 2);
  EXPECT_THAT(Borders(), SizeIs(1));
  scene_.AddLandmarks(kPoints / 2, kPoints, {keyframes_[0][2], keyframes_[1][3]});
  EXPECT_THAT(Borders(), IsEmpty());
}

TEST_F(BridgeFinderTest, AFewCommonLandmarksAreEnough) {
  MakeParts(kPoints / 8);
  const Bridge bridge = Find();
  ASSERT_THAT(bridge.reason, IsEmpty());
  EXPECT_LT(bridge.common, 100);
  EXPECT_NEAR(SecondFromFirst(bridge).scale, kDrift.scale, 0.04);
}

TEST_F(BridgeFinderTest, WhatABlurredTurnShowsNotIsFoundBeyondIt) {
  for (const int side : {0, 1}) {
    const PartId part = scene_.map.BeginPart();
    for (int i = 0; i < kKeyframes; ++i) {
      const bool is_clear = side == 0 ? i < 2 : i >= 4;
      const SyntheticWorld as_it_looks = world_;
      if (!is_clear) world_.Repaint(0);
      keyframes_[side].push_back(scene_.Add(SidewaysPose(0.1 * (kKeyframes * side + i)), part));
      if (is_clear) continue;
      world_ = as_it_looks;
      LoseFrames(1);  // time goes on
    }
    const std::vector<KeyframeId>& all = keyframes_[side];
    scene_.AddLandmarks(0, kPoints / 2, all);
    scene_.AddLandmarks(kPoints / 2, kPoints, {side == 0 ? all[1] : all[4], side == 0 ? all[0] : all[5]});
  }
  scene_.Drift(keyframes_[1], kDrift);
  const Bridge bridge = Find();
  ASSERT_THAT(bridge.reason, IsEmpty());
  ExpectKDrift(bridge);
}

TEST_F(BridgeFinderTest, AnotherPlaceIsNoBridge) {
  MakeParts(0);
  EXPECT_THAT(Find().reason, HasSubstr("0 landmarks are on both sides"));
}

TEST_F(BridgeFinderTest, PartsOfWhichNobodyKnowsTheScaleAreLeftApart) {
  MakeParts();
  // Every other landmark of the second part is half as far again as it should be, as seen from the border.
  const Eigen::Vector3d from = scene_.map.keyframes().At(keyframes_[1][0]).CenterInWorld();
  scene_.map.landmarks().ForEach([&](Landmark& landmark) {
    if (landmark.created_by() != keyframes_[1].back() || landmark.id().value() % 2 == 0) return;
    landmark.Transform({1.8, Eigen::Quaterniond::Identity(), -0.8 * from});
  });
  EXPECT_THAT(Find().reason, HasSubstr("about one scale"));
}

TEST_F(BridgeFinderTest, OneKeyframeAloneIsNotBelieved) {
  MakeParts();
  for (int i = 0; i < 2 * kKeyframes; ++i) {  // each is turned by another angle
    Keyframe& keyframe =
        scene_.map.keyframes().At(keyframes_[i / kKeyframes][static_cast<size_t>(i % kKeyframes)]);
    const Rigid3 turn(ExpSo3({0, 0.045 * std::abs(i - kKeyframes + 0.5), 0}), Eigen::Vector3d::Zero());
    keyframe.set_cam_from_world(turn * keyframe.cam_from_world());
  }
  EXPECT_THAT(Find().reason, HasSubstr("agree < 2"));
}

TEST_F(BridgeFinderTest, ALongGapIsNoBorder) {
  MakeSide(0, scene_.map.BeginPart());
  LoseFrames(3);
  MakeSide(1, scene_.map.BeginPart());
  EXPECT_THAT(Borders(), SizeIs(1));
  LoseFrames(4);
  keyframes_[1].clear();
  MakeSide(1, scene_.map.BeginPart());
  EXPECT_THAT(Borders(), SizeIs(1)) << "no other";
  EXPECT_THAT(Finder().Borders(KnownPoses(&scene_.shared_map)), IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
