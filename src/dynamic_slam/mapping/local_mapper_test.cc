#include "dynamic_slam/mapping/local_mapper.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/landmark_fusion.h"
#include "dynamic_slam/map/synthetic_world.h"
#include "dynamic_slam/mapping/landmark_factory.h"
#include "dynamic_slam/mapping/map_bundle.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;

constexpr uint32_t kPoints = 800;

// Two keyframes that share the landmarks of a quarter of the points.
struct TwoKeyframes {
  explicit TwoKeyframes(double baseline) {
    first = scene.Add(Rigid3());
    second = scene.Add(SidewaysPose(baseline));
    scene.AddLandmarks(0, kPoints / 4, {first, second});
  }
  int CountShared() const {
    const auto &a = scene.views[0].points, &b = scene.views[1].points;  // both in ascending order
    std::vector<uint32_t> both;
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
    return static_cast<int>(both.size());
  }
  SyntheticWorld world{kPoints};
  SyntheticMap scene{&world};
  KeyframeId first, second;
};

std::vector<LandmarkId> CreateLandmarks(TwoKeyframes* two, const MapperOptions& options = {}) {
  const LandmarkFactory factory(two->world.camera(), options);
  std::vector<LandmarkId> created;
  for (const KeyframeId neighbour : factory.Neighbours(two->scene.map, two->second)) {
    const auto added =
        LandmarkFactory::Add(factory.Propose(two->scene.map, two->second, neighbour), &two->scene.map);
    created.insert(created.end(), added.begin(), added.end());
  }
  return created;
}

// A keyframe whose keypoints each have a double, which `change` makes another.
template <class Change>
KeyframeId AddWithDoubles(const Rigid3& cam_from_world, const Change& change, SyntheticWorld* world,
                          SyntheticMap* scene) {
  SyntheticView view = world->See(cam_from_world);
  FeatureSet& features = view.frame.features;
  const size_t count = features.size();
  for (size_t i = 0; i < count; ++i) {
    Keypoint twin = features.keypoints[i];
    change(&twin);
    features.keypoints.push_back(twin);
    features.descriptors.push_back(features.descriptors[i]);
    view.points.push_back(view.points[i]);
  }
  view.frame.grid.Build(features, world->camera().IdealBounds());
  view.frame.ClearLandmarks();
  view.frame.static_probability.assign(features.size(), 1.0f);
  scene->views.push_back(view);
  return InsertKeyframe(scene->views.back().frame, &scene->map, PartId(0));
}

TEST(LandmarkFactoryTest, NewLandmarksAreNearTheTruth) {
  TwoKeyframes two(0.5);
  Map& map = two.scene.map;
  const int possible = two.CountShared() - static_cast<int>(map.landmarks().size());
  const std::vector<LandmarkId> created = CreateLandmarks(&two);
  EXPECT_GT(static_cast<int>(created.size()), 0.85 * possible);
  std::vector<double> errors;
  int wrong = 0;
  for (const LandmarkId id : created) {
    const Landmark& landmark = map.landmarks().At(id);
    ASSERT_EQ(landmark.observations().size(), 2u);
    const uint32_t point = two.scene.PointOf(landmark.observations()[0]);
    wrong += point != two.scene.PointOf(landmark.observations()[1]);
    errors.push_back((landmark.position() - two.world.position(point)).norm() / landmark.position().z());
    EXPECT_GT(landmark.max_distance(), 0) << "not refreshed";
  }
  EXPECT_LE(wrong, 2);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.02);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.08);
  EXPECT_THAT(map.Validate(), IsEmpty());
}

TEST(LandmarkFactoryTest, WithoutParallaxThereAreNone) {
  TwoKeyframes two(0.07);  // 0.6 to 1.4 deg
  MapperOptions options;
  options.min_baseline_ratio = 0.001;
  options.min_parallax_deg = 2;
  EXPECT_THAT(CreateLandmarks(&two, options), IsEmpty());
  options.min_parallax_deg = 0.1;
  EXPECT_GT(CreateLandmarks(&two, options).size(), 100u) << "it was the parallax";
}

TEST(LandmarkFactoryTest, NeighboursAtTheSamePlaceAreLeftOut) {
  TwoKeyframes two(0.03);
  MapperOptions options;
  options.min_parallax_deg = 0;
  EXPECT_THAT(CreateLandmarks(&two, options), IsEmpty());
}

TEST(LandmarkFactoryTest, NeighboursThatShareLessAreAskedWhereTheOthersAreTooNear) {
  SyntheticWorld world(kPoints);
  SyntheticMap scene(&world);
  const KeyframeId far = scene.Add(SidewaysPose(-0.5));
  const KeyframeId near = scene.Add(SidewaysPose(0.02)), newest = scene.Add(Rigid3());
  scene.AddLandmarks(0, kPoints / 2, {far, near, newest});
  scene.AddLandmarks(kPoints / 2, kPoints, {near, newest});
  MapperOptions options;
  options.triangulation_neighbours = 1;
  EXPECT_THAT(LandmarkFactory(world.camera(), options).Neighbours(scene.map, newest),
              testing::ElementsAre(far));
}

TEST(LandmarkFactoryTest, NothingIsMadeBehindTheCamera) {
  TwoKeyframes two(0.5);
  // As if the camera had gone the other way: all rays meet behind it.
  two.scene.map.keyframes().At(two.second).set_cam_from_world(SidewaysPose(-0.5));
  EXPECT_LE(CreateLandmarks(&two).size(), 2u);
}

TEST(LandmarkFactoryTest, NothingIsMadeOfWhatMoves) {
  constexpr float kMoversFromPx = 300;
  SyntheticWorld world(kPoints);
  SyntheticMap scene(&world);
  const KeyframeId first = scene.Add(Rigid3(), PartId(0), kMoversFromPx);
  const KeyframeId second = scene.Add(SidewaysPose(0.5), PartId(0), kMoversFromPx);
  scene.AddLandmarks(0, kPoints / 4, {first, second});
  const auto proposals = LandmarkFactory(world.camera(), {}).Propose(scene.map, second, first);
  EXPECT_GT(proposals.size(), 50u);
  for (const LandmarkProposal& proposal : proposals) {
    EXPECT_LT(scene.map.keyframes().At(first).keypoint(proposal.second_keypoint).x, kMoversFromPx);
    EXPECT_LT(scene.map.keyframes().At(second).keypoint(proposal.first_keypoint).x, kMoversFromPx);
  }
}

TEST(LandmarkFactoryTest, ACornerInTwoOctavesIsOneAndTwoThatLookTheSameAreNone) {
  const auto propose = [](int octaves_up, float px_right) {
    SyntheticWorld world(kPoints);
    SyntheticMap scene(&world);
    const auto change = [&](Keypoint* twin) {
      twin->octave = std::min(twin->octave + octaves_up, SyntheticWorld::kOctaves - 1);
      twin->x += px_right;
    };
    const KeyframeId first = AddWithDoubles(Rigid3(), change, &world, &scene);
    const KeyframeId second = scene.Add(SidewaysPose(0.5));
    scene.AddLandmarks(0, kPoints / 4, {first, second});
    return LandmarkFactory(world.camera(), {}).Propose(scene.map, second, first).size();
  };
  EXPECT_GT(propose(1, 0), 150u) << "in the next octave, at the same place";
  EXPECT_LT(propose(0, 40), 15u) << "elsewhere on the epipolar line";
}

TEST(LandmarkFactoryTest, OctavesMustTellTheDistancesThatTheRaysTell) {
  const auto propose = [](int octaves_up) {
    SyntheticWorld world(kPoints);
    SyntheticMap scene(&world);
    // The first camera is two behind the second: what it sees is smaller, in lower octaves.
    const Rigid3 behind(Eigen::Quaterniond::Identity(), {-0.5, 0, 2});
    const auto change = [&](Keypoint* twin) {
      twin->octave = std::min(twin->octave + octaves_up, SyntheticWorld::kOctaves - 1);
    };
    SyntheticView view = world.See(behind);
    for (Keypoint& keypoint : view.frame.features.keypoints) change(&keypoint);
    view.frame.grid.Build(view.frame.features, world.camera().IdealBounds());
    view.frame.static_probability.assign(view.frame.features.size(), 1.0f);
    scene.views.push_back(view);
    const KeyframeId first = InsertKeyframe(scene.views.back().frame, &scene.map, PartId(0));
    const KeyframeId second = scene.Add(Rigid3());
    scene.AddLandmarks(0, kPoints / 4, {first, second});
    return LandmarkFactory(world.camera(), {}).Propose(scene.map, second, first).size();
  };
  const size_t as_they_are = propose(0);
  EXPECT_GT(as_they_are, 100u);
  EXPECT_LT(propose(4), as_they_are / 4);
}

TEST(LandmarkFactoryTest, AKeypointGetsOneLandmark) {
  TwoKeyframes two(0.5);
  const auto proposals =
      LandmarkFactory(two.world.camera(), {}).Propose(two.scene.map, two.second, two.first);
  ASSERT_GT(proposals.size(), 2u);
  LandmarkProposal same_first = proposals[1], same_second = proposals[2];
  same_first.first_keypoint = proposals[0].first_keypoint;
  same_second.second_keypoint = proposals[0].second_keypoint;
  EXPECT_EQ(LandmarkFactory::Add({proposals[0], same_first, same_second}, &two.scene.map).size(), 1u);
  EXPECT_THAT(two.scene.map.Validate(), IsEmpty());
}

// Keyframes that go on with their back to where they go: the neighbour is ahead, and has passed the start of
// each ray.
TEST(LandmarkFactoryTest, ANeighbourAheadIsSearchedToo) {
  SyntheticWorld world(kPoints);
  for (const double step : {0.7, -0.7}) {
    SyntheticMap scene(&world);
    const KeyframeId first = scene.Add(Rigid3());
    const KeyframeId second = scene.Add(Rigid3(ExpSo3({0, 0, 0}), {0.2, 0, -step}));
    scene.AddLandmarks(0, kPoints / 4, {first, second});
    MapperOptions options;
    options.min_parallax_deg = 0.1;
    const LandmarkFactory factory(world.camera(), options);
    EXPECT_GT(factory.Propose(scene.map, second, first).size(), 100u) << step;
  }
}

// The camera passes a place of which only a part is known again; what nobody knows again becomes landmarks
// anew.
struct PlaceMappedTwice {
  PlaceMappedTwice() {
    for (int i = 0; i < 8; ++i) ids.push_back(scene.Add(SidewaysPose(0.1 * (i % 4))));
    scene.AddLandmarks(0, kPoints / 2, ids);
    for (const std::vector<KeyframeId>& visit :
         {std::vector(ids.begin(), ids.begin() + 4), std::vector(ids.begin() + 4, ids.end())})
      scene.AddLandmarks(kPoints / 2, kPoints, visit);
  }

  // Points that several landmarks show, and landmarks that show several points.
  std::pair<int, int> CountTwinsAndMistakes() const {
    std::vector<int> landmarks_of(kPoints, 0);
    int mistakes = 0;
    scene.map.landmarks().ForEach([&](const Landmark& landmark) {
      const uint32_t point = scene.PointOf(landmark.observations().front());
      ++landmarks_of[point];
      mistakes += std::ranges::any_of(landmark.observations(), [&](const Observation& observation) {
        return scene.PointOf(observation) != point;
      });
    });
    const auto twins = std::ranges::count_if(landmarks_of, [](int n) { return n > 1; });
    return {static_cast<int>(twins), mistakes};
  }

  SyntheticWorld world{kPoints};
  SyntheticMap scene{&world};
  std::vector<KeyframeId> ids;
};

TEST(LocalMapperTest, InTheEndWhatIsTwiceBecomesOne) {
  PlaceMappedTwice place;
  const int twins = place.CountTwinsAndMistakes().first;
  ASSERT_GT(twins, 150);
  LocalMapper mapper(place.world.camera(), {}, &place.scene.shared_map);
  EXPECT_TRUE(mapper.Finish().usable);
  const auto [left, mistakes] = place.CountTwinsAndMistakes();
  EXPECT_LT(left, twins / 50);
  EXPECT_LE(mistakes, twins / 100);
  EXPECT_THAT(place.scene.map.Validate(), IsEmpty());
}

TEST(LocalMapperTest, StoppedInTheEndItMergesNothing) {
  PlaceMappedTwice place;
  const auto before = place.CountTwinsAndMistakes();
  LocalMapper(place.world.camera(), {}, &place.scene.shared_map).Finish([] { return true; });
  EXPECT_EQ(place.CountTwinsAndMistakes(), before);
  EXPECT_THAT(place.scene.map.Validate(), IsEmpty());
}

TEST(LandmarkFusionTest, TwinsAreMergedOnlyWhereKeyframesLieBetween) {
  PlaceMappedTwice place;
  LandmarkFusion fusion(place.world.camera(), place.scene.map.octave_scales());
  const std::vector<LandmarkId> first_visit = place.scene.map.keyframes().At(place.ids[0]).landmarks();
  // From any keyframe of the first visit to the second one's first it is 4 at most, to its last 4 or more.
  EXPECT_EQ(fusion.MergeTwins(place.ids[4], first_visit, 5, &place.scene.map), 0);
  EXPECT_GT(fusion.MergeTwins(place.ids[7], first_visit, 4, &place.scene.map), 100);
  EXPECT_THAT(place.scene.map.Validate(), IsEmpty());
}

TEST(LocalMapperTest, ARedundantKeyframeGoesAndItsFramesStay) {
  SyntheticWorld world(400);
  SyntheticMap scene(&world);
  LocalMapper mapper(world.camera(), {}, &scene.shared_map);
  std::vector<KeyframeId> ids;
  for (int i = 0; i < 6; ++i) ids.push_back(scene.Add(SidewaysPose(0.05 * i)));
  scene.AddLandmarks(0, 400, ids);
  const MappingResult result = mapper.Process(ids.back(), 0);
  EXPECT_GE(result.culled_keyframes, 1);
  EXPECT_EQ(scene.map.keyframes().size(), ids.size() - static_cast<size_t>(result.culled_keyframes));
  EXPECT_TRUE(scene.map.keyframes().Contains(ids.front())) << "the origin stays";
  EXPECT_TRUE(scene.map.keyframes().Contains(ids.back())) << "the new one stays";
  for (size_t i = 0; i < ids.size(); ++i) {
    const Rigid3 pose = scene.map.PoseFromReference(ids[i], Rigid3());
    EXPECT_LT((pose.translation - scene.views[i].frame.cam_from_world.translation).norm(), 0.01) << i;
  }
  EXPECT_THAT(scene.map.Validate(), IsEmpty());
}

TEST(LocalMapperTest, WhatWaitsToBeMappedIsNotCulled) {
  SyntheticWorld world(400);
  SyntheticMap scene(&world);
  LocalMapper mapper(world.camera(), {}, &scene.shared_map);
  std::vector<KeyframeId> ids;
  for (int i = 0; i < 8; ++i) ids.push_back(scene.Add(SidewaysPose(0.05 * i)));
  scene.AddLandmarks(0, 400, ids);
  EXPECT_GE(mapper.Process(ids[2], 0).culled_keyframes, 1);
  for (int i = 2; i < 8; ++i) EXPECT_TRUE(scene.map.keyframes().Contains(ids[i])) << i;
}

TEST(LocalMapperTest, TheOriginStaysThoughItIsRedundant) {
  SyntheticWorld world(400);
  SyntheticMap scene(&world);
  LocalMapper mapper(world.camera(), {}, &scene.shared_map);
  std::vector<KeyframeId> ids;
  for (const double x : {0.0, 0.4, -0.4, 0.45, -0.45, 0.0}) ids.push_back(scene.Add(SidewaysPose(x)));
  scene.AddLandmarks(0, 400, ids);
  ASSERT_EQ(scene.map.keyframes().At(ids.back()).BestCovisible(1).front().id, ids.front()) << "asked first";
  mapper.Process(ids.back(), 0);
  EXPECT_TRUE(scene.map.keyframes().Contains(ids.front()));
}

TEST(LocalMapperTest, AKeyframeFromAfarIsNotRedundantByThoseThatAreNear) {
  SyntheticWorld world(400);
  const auto survives = [&](double z) {
    SyntheticMap scene(&world);
    LocalMapper mapper(world.camera(), {}, &scene.shared_map);
    std::vector<KeyframeId> ids;
    for (int i = 0; i < 6; ++i) {
      ids.push_back(scene.Add(Rigid3(Eigen::Quaterniond::Identity(), {-0.02 * i, 0, i == 4 ? z : 0.0})));
    }
    scene.AddLandmarks(0, 400, ids);
    mapper.Process(ids.back(), 0);
    return scene.map.keyframes().Contains(ids[4]);
  };
  EXPECT_FALSE(survives(0));
  EXPECT_TRUE(survives(5));
}

TEST(LocalMapperTest, ALandmarkThatTrackingDoesNotFindIsCulled) {
  TwoKeyframes two(0.4);
  Map& map = two.scene.map;
  LocalMapper mapper(two.world.camera(), {}, &two.scene.shared_map);
  const MappingResult first = mapper.Process(two.second, 0);
  ASSERT_GT(first.created, 100);
  LandmarkId unfound, unseen;
  map.landmarks().ForEach([&](const Landmark& landmark) {
    if (landmark.created_by() == two.second && landmark.observations().size() == 2) {
      unfound = unseen;
      unseen = landmark.id();
    }
  });
  ASSERT_TRUE(unfound.IsValid() && unseen.IsValid());
  map.landmarks().At(unfound).visible_count = 1000;
  // Far away, so that nobody sees the other one again.
  const Rigid3 elsewhere(ExpSo3({0, 0.9, 0}), {0, 0, 0});
  mapper.Process(two.scene.Add(elsewhere), 0);
  EXPECT_FALSE(map.landmarks().Contains(unfound));
  EXPECT_TRUE(map.landmarks().Contains(unseen)) << "still on probation";
  mapper.Process(two.scene.Add(elsewhere), 0);
  EXPECT_FALSE(map.landmarks().Contains(unseen));
  EXPECT_THAT(map.Validate(), IsEmpty());
}

// Of a map that was loaded: what is not found where it should be has moved since.
TEST(LocalMapperTest, LandmarksThatMovedBetweenVisitsFade) {
  TwoKeyframes two(0.5);
  Map& map = two.scene.map;
  std::vector<LandmarkId> moved, still_there, own;
  map.landmarks().ForEach([&](Landmark& landmark) {
    const uint32_t kind = landmark.id().value() % 3;
    landmark.visible_count = 20;
    landmark.found_count = kind == 1 ? 10 : 2;
    landmark.is_from_file = kind != 2;
    (kind == 0 ? moved : kind == 1 ? still_there : own).push_back(landmark.id());
  });
  ASSERT_GT(moved.size(), 10u);
  LocalMapper mapper(two.world.camera(), {}, &two.scene.shared_map);
  mapper.Process(two.second, map.epoch());
  for (const LandmarkId id : moved) EXPECT_FALSE(map.landmarks().Contains(id));
  for (const LandmarkId id : still_there) EXPECT_TRUE(map.Resolve(id).IsValid());
  for (const LandmarkId id : own) EXPECT_TRUE(map.Resolve(id).IsValid());
  EXPECT_THAT(map.Validate(), IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
