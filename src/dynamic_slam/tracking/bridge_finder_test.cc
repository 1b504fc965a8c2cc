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
using testing::Not;
using testing::SizeIs;

constexpr uint32_t kPoints = 1500;

// A camera that moves sideways, a frame a second. After six it was lost for a moment, and what follows is a
// part of the map of its own, with a world and a unit of length of its own.
class BridgeFinderTest : public testing::Test {
 protected:
  static constexpr int kKeyframes = 6;  // of either part

  // The first points look the same to both parts.
  void MakeParts(size_t same_points = kPoints) {
    for (int part = 0; part < 2; ++part) {
      if (part == 1) world_.Repaint(same_points);
      const PartId id = scene_.map.BeginPart();
      for (int i = 0; i < kKeyframes; ++i)
        keyframes_[part].push_back(scene_.Add(SidewaysPose(0.1 * (kKeyframes * part + i)), id));
      scene_.AddLandmarks(0, kPoints, keyframes_[part]);
    }
    scene_.Drift(keyframes_[1], kDrift);
  }

  KnownPoses Known(double gap_s = 0) const {
    std::vector<AnchoredPose> poses;
    scene_.map.keyframes().ForEach([&](const Keyframe& keyframe) {
      const double later_s = keyframe.part() == scene_.map.PartOf(keyframes_[0][0]) ? 0 : gap_s;
      poses.push_back({keyframe.timestamp_s() + later_s, keyframe.id(), Rigid3()});
    });
    return KnownPoses(poses, &scene_.shared_map);
  }

  Bridge Find() {
    const KnownPoses known = Known();
    const std::vector<BridgeFinder::Border> borders = BridgeFinder::Borders(known);
    EXPECT_THAT(borders, SizeIs(1));
    return BridgeFinder(world_.camera(), TrackerOptions(), &scene_.shared_map).Find(known, borders.at(0));
  }

  // The second part's world from the first one's.
  Sim3 SecondFromFirst(const Bridge& bridge) const {
    const Keyframe& keyframe = scene_.map.keyframes().At(bridge.keyframe);
    const Keyframe& neighbour = scene_.map.keyframes().At(bridge.neighbour);
    const Sim3 here_from_there = ToSim3(keyframe.cam_from_world()).Inverse() *
                                 bridge.keyframe_from_neighbour * ToSim3(neighbour.cam_from_world());
    return keyframe.part() == scene_.map.PartOf(keyframes_[1][0]) ? here_from_there
                                                                  : here_from_there.Inverse();
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
  const Sim3 found = SecondFromFirst(bridge);
  EXPECT_NEAR(found.scale, kDrift.scale, 0.02);
  EXPECT_LT(found.rotation.angularDistance(kDrift.rotation), 0.005);
  EXPECT_LT((found.translation - kDrift.translation).norm(), 0.05);
}

TEST_F(BridgeFinderTest, AFewCommonLandmarksAreEnough) {
  MakeParts(kPoints / 8);
  const Bridge bridge = Find();
  ASSERT_THAT(bridge.reason, IsEmpty());
  EXPECT_LT(bridge.common, 100);
  EXPECT_NEAR(SecondFromFirst(bridge).scale, kDrift.scale, 0.04);
}

TEST_F(BridgeFinderTest, AnotherPlaceIsNoBridge) {
  MakeParts(0);
  EXPECT_THAT(Find().reason, HasSubstr("0 landmarks are in both parts"));
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

TEST_F(BridgeFinderTest, PartsThatWereJoinedMeanwhileAreNone) {
  MakeParts();
  const KnownPoses known = Known();
  const std::vector<BridgeFinder::Border> borders = BridgeFinder::Borders(known);
  scene_.map.MergePart(scene_.map.PartOf(keyframes_[1][0]), scene_.map.PartOf(keyframes_[0][0]),
                       kDrift.Inverse());
  BridgeFinder finder(world_.camera(), TrackerOptions(), &scene_.shared_map);
  EXPECT_THAT(finder.Find(known, borders.at(0)).reason, Not(IsEmpty()));
  EXPECT_THAT(BridgeFinder::Borders(known), IsEmpty());
}

TEST_F(BridgeFinderTest, ALongGapIsNoBorder) {
  MakeParts();
  EXPECT_THAT(BridgeFinder::Borders(Known(3)), SizeIs(1));
  EXPECT_THAT(BridgeFinder::Borders(Known(4)), IsEmpty());
  EXPECT_THAT(BridgeFinder::Borders(KnownPoses(&scene_.shared_map)), IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
