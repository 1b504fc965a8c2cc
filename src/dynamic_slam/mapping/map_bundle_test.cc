#include "dynamic_slam/mapping/map_bundle.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;

TEST(MapBundleTest, FindsTheTruthAndBreaksWrongLinks) {
  SyntheticWorld world(400, 0.01);
  SyntheticMap scene(&world);
  std::vector<KeyframeId> ids;
  for (int i = 0; i < 5; ++i) ids.push_back(scene.Add(SidewaysPose(0.2 * i)));
  scene.AddLandmarks(0, 399, ids);
  // A keypoint that is none of this landmark.
  const auto& points = scene.views[2].points;
  const uint32_t free = static_cast<uint32_t>(
      std::find_if(points.begin(), points.end(),
                   [&](const uint32_t& point) {
                     return !scene.map.keyframes()
                                 .At(ids[2])
                                 .landmarks()[static_cast<size_t>(&point - points.data())]
                                 .IsValid();
                   }) -
      points.begin());
  ASSERT_LT(free, points.size());
  const LandmarkId misled = [&] {
    LandmarkId found;
    scene.map.landmarks().ForEach([&](const Landmark& landmark) {
      if (!landmark.IsSeenBy(ids[2]) && landmark.observations().size() >= 2) found = landmark.id();
    });
    return found;
  }();
  ASSERT_TRUE(misled.IsValid());
  scene.map.Link(ids[2], free, misled);

  Random random(8);
  for (size_t i = 2; i < ids.size(); ++i) {
    Rigid3 pose = scene.map.keyframes().At(ids[i]).cam_from_world();
    pose.translation += 0.02 * Eigen::Vector3d(random.Gaussian(), random.Gaussian(), random.Gaussian());
    scene.map.keyframes().At(ids[i]).set_cam_from_world(pose);
  }
  const BundleSummary summary = AdjustAll(world.camera(), {}, {}, &scene.shared_map);
  EXPECT_TRUE(summary.usable);
  EXPECT_FALSE(scene.map.keyframes().At(ids[2]).landmarks()[free].IsValid());
  // The scale is free: compare the shape of the path.
  const double unit = scene.map.keyframes().At(ids[1]).CenterInWorld().x() / 0.2;
  for (size_t i = 0; i < ids.size(); ++i) {
    const Eigen::Vector3d center = scene.map.keyframes().At(ids[i]).CenterInWorld() / unit;
    EXPECT_LT((center - Eigen::Vector3d(0.2 * static_cast<double>(i), 0, 0)).norm(), 0.003) << i;
  }
  EXPECT_THAT(scene.map.Validate(), IsEmpty());
}

// Three noisy keyframes tell where the middle one is; eighteen frames between them see the same and tell it
// better.
TEST(MapBundleTest, FramesThatSeeTheMapTellWhereItIs) {
  SyntheticWorld world(400, 0.5);
  const auto error_with = [&world](bool with_views) {
    SyntheticMap scene(&world);
    std::vector<KeyframeId> ids;
    for (const double x : {0.0, 0.2, 0.4}) ids.push_back(scene.Add(SidewaysPose(x)));
    scene.AddLandmarks(0, 399, ids);
    std::vector<LandmarkId> landmark_of(world.size());
    const auto& points = scene.views[0].points;
    for (size_t i = 0; i < points.size(); ++i)
      landmark_of[points[i]] = scene.map.keyframes().At(ids[0]).landmarks()[i];
    std::vector<FrameView> views;
    for (int i = 1; with_views && i < 20; ++i) {
      if (i % 10 == 0) continue;
      const SyntheticView seen = world.See(SidewaysPose(0.02 * i));
      FrameView view{0.1 * i, PartId(0), SidewaysPose(0.02 * i + 0.005), {}};
      for (size_t k = 0; k < seen.points.size(); ++k) {
        const LandmarkId landmark = landmark_of[seen.points[k]];
        const Keypoint& keypoint = seen.frame.features.keypoints[k];
        if (landmark.IsValid())
          view.sightings.push_back({landmark, {keypoint.x, keypoint.y}, keypoint.octave, 1});
      }
      views.push_back(view);
    }
    std::map<PartId, MotionNoise> noise;
    const PathEvidence path{views, &noise};
    EXPECT_TRUE(AdjustAll(world.camera(), {}, {}, &scene.shared_map, &path).usable);
    EXPECT_THAT(scene.map.Validate(), IsEmpty());
    const auto centre = [&](size_t i) { return scene.map.keyframes().At(ids[i]).CenterInWorld(); };
    // The scale is free: halfway is halfway.
    return (centre(1) - 0.5 * (centre(0) + centre(2))).norm() / (centre(2) - centre(0)).norm();
  };
  const double with_views = error_with(true), without = error_with(false);
  EXPECT_LT(with_views, 0.7 * without) << without;
}

TEST(MapBundleTest, WhatCameMeanwhileMovesAlong) {
  SyntheticWorld world(400);
  SyntheticMap scene(&world);
  std::vector<KeyframeId> ids;
  for (int i = 0; i < 5; ++i) ids.push_back(scene.Add(SidewaysPose(0.2 * i)));
  scene.AddLandmarks(0, 300, ids);
  Rigid3 pose = scene.map.keyframes().At(ids[4]).cam_from_world();
  pose.translation += Eigen::Vector3d(0.05, 0, 0);
  scene.map.keyframes().At(ids[4]).set_cam_from_world(pose);

  LandmarkId younger;
  const Eigen::Vector3d x_in_cam(0.1, 0.2, 3);
  const auto free_keypoint = [&](KeyframeId id) {
    const auto& landmarks = scene.map.keyframes().At(id).landmarks();
    return static_cast<uint32_t>(std::find(landmarks.begin(), landmarks.end(), LandmarkId()) -
                                 landmarks.begin());
  };
  const auto add_one = [&] {
    if (younger.IsValid()) return false;
    const auto map = scene.shared_map.Write();
    younger =
        map->AddLandmark(map->keyframes().At(ids[4]).cam_from_world().Inverse() * x_in_cam, ids[4]).id();
    for (const KeyframeId id : {ids[0], ids[4]}) map->Link(id, free_keypoint(id), younger);
    map->RefreshLandmark(younger);
    return false;
  };
  ASSERT_TRUE(AdjustAll(world.camera(), {}, add_one, &scene.shared_map).usable);
  ASSERT_TRUE(younger.IsValid());
  const Rigid3 after = scene.map.keyframes().At(ids[4]).cam_from_world();
  EXPECT_GT((after.translation - pose.translation).norm(), 0.02) << "there was something to go along with";
  EXPECT_LT((after * scene.map.landmarks().At(younger).position() - x_in_cam).norm(), 1e-9);
  EXPECT_THAT(scene.map.Validate(), IsEmpty());
}

// A camera that passes few points at a steady pace.
struct Passage {
  static constexpr int kKeyframes = 24;

  explicit Passage(bool from_file = false) {
    for (int i = 0; i < kKeyframes; ++i) {
      SyntheticView view = world.See(SidewaysPose(kStep * i));
      if (from_file) view.frame.id = FrameId();
      view.frame.static_probability.assign(view.frame.features.size(), 1.0f);
      scene.views.push_back(std::move(view));
      ids.push_back(InsertKeyframe(scene.views.back().frame, &scene.map, PartId(0)));
    }
    scene.AddLandmarks(0, 79, ids);
  }

  BundleSummary Adjust(bool with_path) {
    const PathEvidence path{{}, &noise};
    return AdjustAll(world.camera(), {}, {}, &scene.shared_map, with_path ? &path : nullptr);
  }
  Eigen::Vector3d Centre(int i) const {
    return scene.map.keyframes().At(ids[static_cast<size_t>(i)]).CenterInWorld();
  }
  // Of the keyframes, over the length of the path: the scale is free.
  double Error() const {
    const Eigen::Vector3d step = (Centre(kKeyframes - 1) - Centre(0)) / (kKeyframes - 1);
    double squares = 0;
    for (int i = 0; i < kKeyframes; ++i) squares += (Centre(i) - Centre(0) - i * step).squaredNorm();
    return std::sqrt(squares / kKeyframes) / step.norm();
  }

  static constexpr double kStep = 0.03;
  SyntheticWorld world{80, 1.0};
  SyntheticMap scene{&world};
  std::vector<KeyframeId> ids;
  std::map<PartId, MotionNoise> noise;
};

TEST(MapBundleTest, WhatCarriesACameraHasMass) {
  Passage each_for_itself, path;
  EXPECT_TRUE(each_for_itself.Adjust(false).usable);
  EXPECT_TRUE(path.Adjust(true).usable);
  EXPECT_LT(path.Error(), 0.5 * each_for_itself.Error()) << each_for_itself.Error();
  EXPECT_THAT(path.scene.map.Validate(), IsEmpty());
}

// A car in a curve is steady as it feels it itself; one that turns while it drives straight on is not.
TEST(MapBundleTest, NoiseIsOfTheVelocityThatChangesLess) {
  for (const bool is_car : {true, false}) {
    SyntheticWorld world(400);
    SyntheticMap scene(&world);
    std::vector<KeyframeId> ids;
    for (int i = 0; i < 24; ++i) {
      const double angle = 0.02 * i;
      const Eigen::Vector3d centre =
          is_car ? Eigen::Vector3d(1 - std::cos(angle), 0, std::sin(angle)) : Eigen::Vector3d(0, 0, angle);
      ids.push_back(scene.Add(Rigid3(ExpSo3({0, angle, 0}), centre).Inverse()));
    }
    scene.AddLandmarks(0, 399, ids);
    std::map<PartId, MotionNoise> noise;
    const PathEvidence path{{}, &noise};
    EXPECT_TRUE(AdjustAll(world.camera(), {}, {}, &scene.shared_map, &path).usable);
    ASSERT_EQ(noise.size(), 1u);
    EXPECT_GT(noise.begin()->second.density, 0);
    EXPECT_EQ(noise.begin()->second.is_in_camera, is_car);
  }
}

// A map that shrinks would be one of a slower camera.
TEST(MapBundleTest, APathKeepsItsLength) {
  Passage path;
  EXPECT_TRUE(path.Adjust(true).usable);
  EXPECT_NEAR((path.Centre(Passage::kKeyframes - 1) - path.Centre(0)).norm(),
              Passage::kStep * (Passage::kKeyframes - 1), 0.1 * Passage::kStep * Passage::kKeyframes);
}

TEST(MapBundleTest, KeyframesOfAFileAreNoPathOfThisRun) {
  Passage each_for_itself(true), path(true);
  EXPECT_TRUE(each_for_itself.Adjust(false).usable);
  EXPECT_TRUE(path.Adjust(true).usable);
  EXPECT_EQ(path.Error(), each_for_itself.Error());
}

}  // namespace
}  // namespace dynamic_slam
