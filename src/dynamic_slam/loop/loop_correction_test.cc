#include "dynamic_slam/loop/loop_correction.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

constexpr int kPasses = 8;
constexpr uint32_t kShared = 100;  // points that four keyframes in a row see, as far as they show there

// The camera goes to the right and comes back. Where it turns it loses sight of all but what it sees from two
// places, a gap apart, and what comes after that is seen through the drift.
struct ThereAndBack {
  explicit ThereAndBack(double gap) : world(12 * kShared), map(&world) {
    for (int i = 0; i < kPasses; ++i) Add(0.1 * i);
    for (int i = 0; i < kPasses; ++i) Add(0.1 * (kPasses - 1 - i) - gap);
    uint32_t point = 0;
    for (const auto& way : {there, back}) {
      for (size_t i = 0; i + 4 <= way.size(); ++i, point += kShared) {
        map.AddLandmarks(point, point + kShared, {way.begin() + i, way.begin() + i + 4});
      }
      if (way == there) {
        map.AddLandmarks(point, point + kShared, {there.back(), back.front()});
        point += kShared;
      }
    }
    for (const KeyframeId id : back) {
      Keyframe& keyframe = map.map.keyframes().At(id);
      keyframe.set_cam_from_world(ToRigid3(ToSim3(keyframe.cam_from_world()) * kDrift.Inverse()));
    }
  }

  void Add(double x) {
    truth.push_back(SidewaysPose(x));
    auto& way = truth.size() <= kPasses ? there : back;
    way.push_back(map.Add(truth.back()));
  }

  Loop LoopAtTheEnd() const {
    const auto pose = [&](KeyframeId id) { return ToSim3(map.map.keyframes().At(id).cam_from_world()); };
    Loop loop{back.back(), there.front(), pose(back.back()) * kDrift * pose(there.front()).Inverse(), {},
              {},          true};
    loop.links.resize(kShared);
    return loop;
  }

  SyntheticWorld world;
  SyntheticMap map;
  std::vector<Rigid3> truth;
  std::vector<KeyframeId> there, back;
};

TEST(LoopCorrectionTest, TheDriftGoesToWhereDepthsWereUncertain) {
  ThereAndBack trip(0.01);
  Map& map = trip.map.map;
  ASSERT_GT(map.keyframes().At(trip.back.front()).WeightOf(trip.there.back()), 30);
  LoopCorrection correction(trip.world.camera(), map, trip.LoopAtTheEnd(), {}, {});
  ASSERT_TRUE(correction.Solve({}));
  correction.Apply(&map);
  for (size_t i = 0; i < trip.truth.size(); ++i) {
    const KeyframeId id(static_cast<uint32_t>(i));
    EXPECT_NEAR(map.UnitOf(id), i < kPasses ? 1 : 1 / kDrift.scale, 0.02) << i;
    const Eigen::Vector3d center = map.keyframes().At(id).CenterInWorld();
    EXPECT_LT((center - trip.truth[i].TargetOriginInSource()).norm(), 0.03) << i;
  }
  EXPECT_THAT(map.Validate(), testing::IsEmpty());
}

TEST(LoopCorrectionTest, TheNewestKeyframesGoTogether) {
  ThereAndBack trip(0.3);  // where depths are as certain as elsewhere, the drift is spread
  Map& map = trip.map.map;
  LoopCorrection correction(trip.world.camera(), map, trip.LoopAtTheEnd(), {}, {});
  ASSERT_TRUE(correction.Solve({}));
  correction.Apply(&map);
  for (auto id = trip.back.end() - 4; id != trip.back.end(); ++id) {
    EXPECT_NEAR(map.UnitOf(*id), 1 / kDrift.scale, 0.02) << id->value();
  }
}

}  // namespace
}  // namespace dynamic_slam
