#include "dynamic_slam/map/landmark_fusion.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;

FusionCount FuseWithNeighbours(const Camera& camera, KeyframeId id, Map* map) {
  LandmarkFusion fusion(camera, map->octave_scales());
  FusionCount sum;
  for (const CovisibleKeyframe& neighbour : map->keyframes().At(id).BestCovisible(10)) {
    for (const auto& [from, to] : {std::pair(id, neighbour.id), std::pair(neighbour.id, id)}) {
      const std::vector<LandmarkId> landmarks = map->keyframes().At(from).landmarks();
      const FusionCount count = fusion.FuseInto(to, landmarks, map);
      sum.linked += count.linked;
      sum.merged += count.merged;
    }
  }
  return sum;
}

TEST(LandmarkFusionTest, DuplicatesBecomeOne) {
  SyntheticWorld world(300);
  SyntheticMap scene(&world);
  std::vector<KeyframeId> ids;
  for (int i = 0; i < 4; ++i) ids.push_back(scene.Add(SidewaysPose(0.1 * i)));
  scene.AddLandmarks(0, 150, {ids[0], ids[1]});
  scene.AddLandmarks(0, 150, {ids[2], ids[3]});  // the same points once more
  scene.AddLandmarks(150, 300, ids);
  const size_t before = scene.map.landmarks().size();

  const FusionCount count = FuseWithNeighbours(world.camera(), ids[3], &scene.map);
  EXPECT_EQ(scene.map.landmarks().size(), before - static_cast<size_t>(count.merged));
  EXPECT_THAT(scene.map.Validate(), IsEmpty());
  std::vector<int> landmarks_of(world.size(), 0);
  scene.map.landmarks().ForEach([&](const Landmark& landmark) {
    const uint32_t point = scene.PointOf(landmark.observations()[0]);
    ++landmarks_of[point];
    for (const Observation& other : landmark.observations()) EXPECT_EQ(scene.PointOf(other), point);
  });
  // Some twins lie beyond the error limit of a noisy keypoint.
  const auto twice = std::count(landmarks_of.begin(), landmarks_of.end(), 2);
  EXPECT_LE(twice, 5);
  EXPECT_GT(count.merged, 50);
}

TEST(LandmarkFusionTest, UnknownSightingsAreLinked) {
  SyntheticWorld world(200);
  SyntheticMap scene(&world);
  std::vector<KeyframeId> ids;
  for (int i = 0; i < 3; ++i) ids.push_back(scene.Add(SidewaysPose(0.1 * i)));
  scene.AddLandmarks(0, 20, ids);
  const int unknown_to_third = scene.AddLandmarks(20, 200, {ids[0], ids[1]});
  const FusionCount count = FuseWithNeighbours(world.camera(), ids[2], &scene.map);
  EXPECT_EQ(count.merged, 0);
  EXPECT_GT(count.linked, 0.85 * unknown_to_third);
  EXPECT_THAT(scene.map.Validate(), IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
