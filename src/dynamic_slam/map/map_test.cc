#include "dynamic_slam/map/map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/local_view.h"

namespace dynamic_slam {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

FeatureSet MakeFeatures(uint32_t count, uint64_t seed) {
  Random random(seed);
  FeatureSet features;
  for (uint32_t i = 0; i < count; ++i) {
    Keypoint keypoint;
    keypoint.x = static_cast<float>(random.Uniform(0, 640));
    keypoint.y = static_cast<float>(random.Uniform(0, 480));
    keypoint.octave = static_cast<int>(random.Index(3));
    features.keypoints.push_back(keypoint);
    features.descriptors.push_back({random.Next(), random.Next(), random.Next(), random.Next()});
  }
  return features;
}

KeyframeId AddKeyframe(Map* map, uint32_t keypoints, const Rigid3& cam_from_world = {}) {
  const uint32_t number = static_cast<uint32_t>(map->keyframes().CreatedCount());
  return map
      ->AddKeyframe(FrameId(number), number, cam_from_world, MakeFeatures(keypoints, number), KeypointGrid())
      .id();
}

Map MakeMap() { return Map({1.0f, 1.2f, 1.44f}); }

LandmarkId AddLandmark(Map* map, const std::vector<Observation>& observations) {
  const LandmarkId id = map->AddLandmark({0, 0, 2}, observations.back().keyframe).id();
  for (const Observation& observation : observations)
    map->Link(observation.keyframe, observation.keypoint, id);
  return id;
}

TEST(MapTest, CovisibilityFollowsTheLinks) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 10), b = AddKeyframe(&map, 10), c = AddKeyframe(&map, 10);
  AddLandmark(&map, {{a, 0}, {b, 0}});
  const LandmarkId all = AddLandmark(&map, {{a, 1}, {b, 1}, {c, 1}});
  const auto best = map.keyframes().At(a).BestCovisible(5);
  ASSERT_EQ(best.size(), 2u);
  EXPECT_EQ(best[0].id, b);
  EXPECT_EQ(best[0].weight, 2);
  EXPECT_EQ(best[1].id, c);
  EXPECT_EQ(best[1].weight, 1);
  map.Unlink(c, 1);
  EXPECT_EQ(map.keyframes().At(a).BestCovisible(5).size(), 1u);
  EXPECT_TRUE(map.landmarks().Contains(all));
  EXPECT_THAT(map.Validate(), IsEmpty());
}

TEST(MapTest, ALandmarkFallsWithItsLastButOneObservation) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 10), b = AddKeyframe(&map, 10);
  const LandmarkId id = AddLandmark(&map, {{a, 3}, {b, 4}});
  map.Unlink(a, 3);
  EXPECT_FALSE(map.landmarks().Contains(id));
  EXPECT_FALSE(map.keyframes().At(b).landmarks()[4].IsValid());
  EXPECT_EQ(map.keyframes().At(b).LandmarkCount(), 0);
  EXPECT_FALSE(map.Resolve(id).IsValid());
  EXPECT_THAT(map.Validate(), IsEmpty());
}

TEST(MapTest, MergedLandmarksResolveToTheSurvivor) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 10), b = AddKeyframe(&map, 10), c = AddKeyframe(&map, 10),
                   d = AddKeyframe(&map, 10);
  const LandmarkId first = AddLandmark(&map, {{a, 0}, {b, 0}});
  const LandmarkId second = AddLandmark(&map, {{b, 1}, {c, 1}});
  const LandmarkId third = AddLandmark(&map, {{c, 2}, {d, 2}});
  map.landmarks().At(first).static_log_odds = 1.5f;
  map.landmarks().At(second).static_log_odds = -0.5f;
  map.MergeLandmarks(second, first);
  EXPECT_FLOAT_EQ(map.landmarks().At(first).static_log_odds, 1) << "evidence of both";
  map.MergeLandmarks(first, third);
  EXPECT_EQ(map.Resolve(second), third);
  EXPECT_EQ(map.Resolve(first), third);
  // b saw the first and the second, c the second and the third: one link each stays.
  EXPECT_EQ(map.landmarks().At(third).observations().size(), 4u);
  EXPECT_FALSE(map.keyframes().At(b).landmarks()[1].IsValid());
  EXPECT_THAT(map.Validate(), IsEmpty());
}

TEST(MapTest, FramesOfAnErasedKeyframeKeepTheirPose) {
  Map map = MakeMap();
  const Rigid3 pose_a(ExpSo3({0.1, 0, 0}), {1, 0, 0}), pose_b(ExpSo3({0, 0.2, 0}), {0, 2, 0}),
      pose_c(ExpSo3({0, 0, 0.3}), {0, 0, 3});
  const KeyframeId a = AddKeyframe(&map, 4, pose_a), b = AddKeyframe(&map, 4, pose_b),
                   c = AddKeyframe(&map, 4, pose_c);
  AddLandmark(&map, {{a, 0}, {b, 0}, {c, 0}});
  const Rigid3 cam_from_a(ExpSo3({0.05, 0.05, 0}), {0.1, 0.2, 0.3});
  const Rigid3 before = map.PoseFromReference(a, cam_from_a);
  map.EraseKeyframe(a, b);
  map.EraseKeyframe(b, c);
  const Rigid3 after = map.PoseFromReference(a, cam_from_a);
  EXPECT_LT((before.translation - after.translation).norm(), 1e-12);
  EXPECT_LT(RotationAngle(before.rotation, after.rotation), 1e-7);
  EXPECT_EQ(map.ResolveKeyframe(a).keyframe, c);
  EXPECT_EQ(map.landmarks().size(), 0u);
  EXPECT_THAT(map.Validate(), IsEmpty());
}

TEST(MapTest, FramesFollowTheScaleOfTheirKeyframeAndOfItsHeir) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 4, Rigid3(ExpSo3({0.1, 0, 0}), {1, 0, 0}));
  const KeyframeId b = AddKeyframe(&map, 4, Rigid3(ExpSo3({0, 0.2, 0}), {0, 2, 0}));
  const Rigid3 cam_from_a(ExpSo3({0.05, 0.05, 0}), {0.1, 0.2, 0.3});
  const Eigen::Vector3d before = map.PoseFromReference(a, cam_from_a).TargetOriginInSource();
  // The whole world becomes twice as large.
  const auto grow = [&map](KeyframeId id) {
    Keyframe& keyframe = map.keyframes().At(id);
    keyframe.set_cam_from_world(
        {keyframe.cam_from_world().rotation, 2 * keyframe.cam_from_world().translation});
    keyframe.Rescale(2);
  };
  grow(a);
  grow(b);
  EXPECT_LT((map.PoseFromReference(a, cam_from_a).TargetOriginInSource() - 2 * before).norm(), 1e-12);
  EXPECT_EQ(map.UnitOf(a), 2);
  map.EraseKeyframe(a, b);
  EXPECT_LT((map.PoseFromReference(a, cam_from_a).TargetOriginInSource() - 2 * before).norm(), 1e-12);
  grow(b);
  EXPECT_LT((map.PoseFromReference(a, cam_from_a).TargetOriginInSource() - 4 * before).norm(), 1e-12);
}

TEST(MapTest, AFrameIsHungWhereItIsToldWhateverTheScale) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 4, Rigid3(ExpSo3({0.1, 0, 0}), {1, 0, 0}));
  const KeyframeId b = AddKeyframe(&map, 4, Rigid3(ExpSo3({0, 0.2, 0}), {0, 2, 0}));
  map.keyframes().At(a).Rescale(2);
  const Rigid3 pose(ExpSo3({0.3, -0.2, 0.1}), {0.4, 0.5, 0.6});
  for (const bool is_erased : {false, true}) {
    if (is_erased) map.EraseKeyframe(a, b);
    const Rigid3 there = map.PoseFromReference(a, map.CamFromReference(a, pose));
    EXPECT_LT((there.translation - pose.translation).norm(), 1e-12) << is_erased;
    EXPECT_LT(there.rotation.angularDistance(pose.rotation), 1e-7) << is_erased;
  }
}

TEST(MapTest, KnowsThePlacesOfItsKeyframesOnly) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 4), b = AddKeyframe(&map, 4);
  EXPECT_EQ(map.places().size(), 2u);
  map.EraseKeyframe(a, b);
  EXPECT_EQ(map.places().size(), 1u);
  EXPECT_TRUE(map.places().WordsOf(a).empty());
  map.Reset();
  EXPECT_EQ(map.places().size(), 0u);
}

TEST(MapTest, RandomChangesKeepItValid) {
  Map map = MakeMap();
  Random random(5);
  std::vector<KeyframeId> keyframes;
  for (int i = 0; i < 8; ++i) keyframes.push_back(AddKeyframe(&map, 40));
  for (int step = 0; step < 2000; ++step) {
    const uint32_t keyframe = random.Index(8), keypoint = random.Index(40);
    const uint32_t other = (keyframe + 1 + random.Index(7)) % 8, other_keypoint = random.Index(40);
    const LandmarkId mine = map.keyframes().At(keyframes[keyframe]).landmarks()[keypoint];
    const LandmarkId theirs = map.keyframes().At(keyframes[other]).landmarks()[other_keypoint];
    if (!mine.IsValid() && !theirs.IsValid()) {
      AddLandmark(&map, {{keyframes[keyframe], keypoint}, {keyframes[other], other_keypoint}});
    } else if (mine.IsValid() && theirs.IsValid() && mine != theirs) {
      map.MergeLandmarks(mine, theirs);
    } else if (mine.IsValid() && step % 7 == 0) {
      map.Unlink(keyframes[keyframe], keypoint);
    } else if (mine.IsValid() && !theirs.IsValid() && !map.landmarks().At(mine).IsSeenBy(keyframes[other])) {
      map.Link(keyframes[other], other_keypoint, mine);
    }
  }
  EXPECT_GT(map.landmarks().size(), 5u);
  EXPECT_THAT(map.Validate(), IsEmpty());
}

TEST(MapTest, ValidateNamesAPoseThatIsNotFinite) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 4);
  Rigid3 broken;
  broken.translation.x() = std::nan("");
  map.keyframes().At(a).set_cam_from_world(broken);
  EXPECT_THAT(map.Validate(), ElementsAre("keyframe 0: pose is not finite"));
}

TEST(MapTest, LinkingAKeypointTwiceIsABug) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 4), b = AddKeyframe(&map, 4);
  AddLandmark(&map, {{a, 0}, {b, 0}});
  const LandmarkId other = map.AddLandmark({0, 0, 1}, a).id();
  EXPECT_THROW(map.Link(a, 0, other), InternalError);
}

TEST(MapTest, ADistanceTellsTheOctave) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 10), b = AddKeyframe(&map, 10);
  const LandmarkId id = AddLandmark(&map, {{a, 0}, {b, 1}});
  map.RefreshLandmark(id);
  const Landmark& landmark = map.landmarks().At(id);
  const double scale_a = map.octave_scales()[static_cast<size_t>(map.keyframes().At(a).keypoint(0).octave)];
  const double scale_b = map.octave_scales()[static_cast<size_t>(map.keyframes().At(b).keypoint(1).octave)];
  EXPECT_NEAR(landmark.max_distance(), 2 * std::sqrt(scale_a * scale_b), 1e-5);
  EXPECT_NEAR(landmark.min_distance(), landmark.max_distance() / 1.44, 1e-5);
  EXPECT_NEAR(landmark.normal().z(), 1, 1e-6);
}

TEST(MapTest, TheDescriptorFollowsTheObservations) {
  Map map = MakeMap();
  std::vector<Observation> observations;
  for (uint32_t i = 0; i < 5; ++i) observations.push_back({AddKeyframe(&map, 10), i});
  const LandmarkId id = AddLandmark(&map, observations);
  const auto refreshed = [&] {
    map.RefreshLandmark(id);
    return map.landmarks().At(id).descriptor();
  };
  const auto seen_by = [&](const Observation& observation) {
    return map.keyframes().At(observation.keyframe).features().descriptors[observation.keypoint];
  };
  const Descriptor of_all = refreshed();
  const auto chosen = std::find_if(observations.begin(), observations.end(),
                                   [&](const Observation& o) { return seen_by(o) == of_all; });
  ASSERT_NE(chosen, observations.end());
  map.Unlink(chosen->keyframe, chosen->keypoint);
  EXPECT_NE(refreshed(), of_all);
  map.Link(chosen->keyframe, chosen->keypoint, id);
  EXPECT_EQ(refreshed(), of_all);
  // Moving it changes nothing.
  map.landmarks().At(id).set_position({0, 0, 3});
  EXPECT_EQ(refreshed(), of_all);
}

// Two cameras beside each other see it from the sides: by how much its image moves when it moves along the
// normal.
TEST(MapTest, TheSpreadIsHowFarItCanBeOffUnseen) {
  Map map = MakeMap();
  const auto at = [](double x) { return Rigid3(Eigen::Quaterniond::Identity(), {-x, 0, 0}); };
  const KeyframeId a = AddKeyframe(&map, 10, at(-0.1)), b = AddKeyframe(&map, 10, at(0.1));
  const LandmarkId id = AddLandmark(&map, {{a, 0}, {b, 1}});
  map.RefreshLandmark(id);
  Landmark& landmark = map.landmarks().At(id);
  double information = 0;
  for (const Observation& observation : landmark.observations()) {
    const Keyframe& keyframe = map.keyframes().At(observation.keyframe);
    const auto image = [&](double z) {
      const Eigen::Vector3d x_in_cam = keyframe.cam_from_world() * Eigen::Vector3d(0, 0, z);
      return Eigen::Vector2d(x_in_cam.head<2>() / x_in_cam.z());
    };
    const double scale =
        map.octave_scales()[static_cast<size_t>(keyframe.keypoint(observation.keypoint).octave)];
    information += ((image(2.001) - image(1.999)) / (0.002 * scale)).squaredNorm();
  }
  const double expected = 1 / std::sqrt(information);
  EXPECT_NEAR(landmark.spread().norm(), expected, 0.01 * expected);
  EXPECT_NEAR(landmark.spread().z(), landmark.spread().norm(), 1e-3 * expected);
  landmark.Transform(
      Sim3{3, Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX())), {1, 2, 3}});
  EXPECT_NEAR(landmark.spread().norm(), 3 * expected, 0.03 * expected);
  EXPECT_NEAR(landmark.spread().normalized().dot(landmark.normal()), 1, 1e-6);
}

std::vector<LandmarkId> Near(const LocalView& view) {
  std::vector<LandmarkId> ids;
  for (const uint32_t entry : view.near) ids.push_back(view.ids[entry]);
  return ids;
}

TEST(LocalViewTest, HoldsWhatTheNeighboursSeeOnce) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 10), b = AddKeyframe(&map, 10), c = AddKeyframe(&map, 10);
  const LandmarkId seen = AddLandmark(&map, {{a, 0}, {b, 0}});
  const LandmarkId near = AddLandmark(&map, {{a, 1}, {b, 1}});
  const LandmarkId beyond = AddLandmark(&map, {{b, 2}, {c, 2}});
  LocalView view;
  LocalViewBuilder builder;
  builder.Build(map, 1, {LandmarkId(), seen, LandmarkId(77)}, 2, &view);
  EXPECT_THAT(Near(view), testing::UnorderedElementsAre(seen, near, beyond));
  EXPECT_EQ(view.reference, b) << "the younger of two with equal votes";
  builder.Build(map, 1, {}, 2, &view);
  EXPECT_EQ(view.size(), 0u);
  EXPECT_FALSE(view.reference.IsValid());
}

TEST(LocalViewTest, CopiesAgainOnlyWhatMayHaveChanged) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 10), b = AddKeyframe(&map, 10);
  const LandmarkId of_a = AddLandmark(&map, {{a, 0}}), of_b = AddLandmark(&map, {{b, 0}});
  LocalView view;
  LocalViewBuilder builder;
  const auto position = [&](size_t k) { return view.positions[view.near[k]]; };
  builder.Build(map, 1, {of_a}, 1, &view);
  EXPECT_THAT(Near(view), testing::ElementsAre(of_a));
  const Eigen::Vector3d before = position(0), after(1, 2, 3);
  ASSERT_NE(before, after);
  map.landmarks().At(of_a).set_position(after);
  builder.Build(map, 1, {of_b}, 1, &view);
  EXPECT_THAT(Near(view), testing::ElementsAre(of_b));
  builder.Build(map, 1, {of_a, of_b}, 2, &view);
  EXPECT_THAT(Near(view), testing::UnorderedElementsAre(of_a, of_b));
  EXPECT_EQ(position(0), before) << "it was told that the map is the same";
  builder.Build(map, 2, {of_a}, 1, &view);
  EXPECT_THAT(Near(view), testing::ElementsAre(of_a));
  EXPECT_EQ(position(0), after);
}

// The builder's table has 2^15 slots.
TEST(LocalViewTest, HoldsLandmarksWhoseIdsShareASlot) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 10);
  const LandmarkId old = AddLandmark(&map, {{a, 0}});
  while (map.landmarks().CreatedCount() % (1 << 15) != old.value()) {
    map.EraseLandmark(map.AddLandmark({0, 0, 1}, a).id());
  }
  const LandmarkId young = AddLandmark(&map, {{a, 1}});
  map.landmarks().At(young).set_position({1, 2, 3});
  LocalView view;
  LocalViewBuilder builder;
  for (const uint64_t writes : {1, 1, 2}) {
    builder.Build(map, writes, {old, young}, 1, &view);
    ASSERT_THAT(Near(view), testing::ElementsAre(old, young));
    EXPECT_EQ(view.positions[view.near[0]], map.landmarks().At(old).position());
    EXPECT_EQ(view.positions[view.near[1]], map.landmarks().At(young).position());
  }
}

TEST(FrameTest, AMergedLandmarkIsLinkedOnce) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 10), b = AddKeyframe(&map, 10), c = AddKeyframe(&map, 10);
  const LandmarkId first = AddLandmark(&map, {{a, 0}, {b, 0}});
  const LandmarkId second = AddLandmark(&map, {{b, 1}, {c, 1}});
  Frame frame;
  frame.id = FrameId(9);
  frame.features = MakeFeatures(10, 9);
  frame.ClearLandmarks();
  frame.landmarks[4] = first;
  frame.landmarks[5] = second;
  map.MergeLandmarks(first, second);
  const KeyframeId inserted = InsertKeyframe(frame, &map);
  EXPECT_EQ(map.keyframes().At(inserted).LandmarkCount(), 1);
  EXPECT_TRUE(map.landmarks().At(second).IsSeenBy(inserted));
  EXPECT_THAT(map.Validate(), IsEmpty());
}

TEST(MapTest, PartsHaveAnOriginEachAndCanBeErased) {
  Map map = MakeMap();
  const PartId first = map.BeginPart();
  const KeyframeId a = AddKeyframe(&map, 10), b = AddKeyframe(&map, 10);
  const PartId second = map.BeginPart();
  ASSERT_NE(first, second);
  const auto add = [&](double x) {
    return map
        .AddKeyframe(FrameId(9), 9, Rigid3(Eigen::Quaterniond::Identity(), {x, 0, 0}), MakeFeatures(10, 9),
                     KeypointGrid(), {}, second)
        .id();
  };
  const KeyframeId c = add(0), d = add(1);
  for (const auto& [one, other] : {std::pair{a, b}, std::pair{c, d}}) {
    const LandmarkId id = map.AddLandmark({0, 0, 1}, one).id();
    map.Link(one, 0, id);
    map.Link(other, 0, id);
  }
  EXPECT_TRUE(map.IsOrigin(a) && map.IsOrigin(c));
  EXPECT_FALSE(map.IsOrigin(b) || map.IsOrigin(d));
  EXPECT_EQ(map.Parts(), (std::vector{first, second}));
  EXPECT_THAT(map.Validate(), IsEmpty());

  const uint32_t epoch = map.epoch();
  map.EraseKeyframe(d, c);
  map.ErasePart(second);
  EXPECT_NE(map.epoch(), epoch);
  EXPECT_EQ(map.Parts(), std::vector{first});
  EXPECT_EQ(map.landmarks().size(), 1u);
  EXPECT_EQ(map.PartOf(a), first);
  EXPECT_FALSE(map.PartOf(c).IsValid());
  EXPECT_FALSE(map.PartOf(d).IsValid()) << "nor what hangs on keyframes that were culled before";
  EXPECT_THAT(map.Validate(), IsEmpty());
  EXPECT_EQ(map.BeginPart(), PartId(2)) << "ids are never reused";
}

TEST(MapTest, APartIsSplitBetweenItsKeyframes) {
  Map map = MakeMap();
  std::vector<KeyframeId> keyframes;
  for (int i = 0; i < 5; ++i) keyframes.push_back(AddKeyframe(&map, 10));
  const auto link = [&](uint32_t keypoint, const std::vector<size_t>& who) {
    const LandmarkId id = map.AddLandmark({0, 0, 1}, keyframes[who[0]]).id();
    for (const size_t i : who) map.Link(keyframes[i], keypoint, id);
    return id;
  };
  const LandmarkId of_first = link(0, {0, 1}), of_second = link(1, {2, 3, 4}),
                   mostly_first = link(2, {0, 1, 2}), mostly_second = link(3, {1, 2, 3, 4}),
                   of_neither = link(4, {1, 2});
  const PartId part = map.SplitPart({keyframes[0], keyframes[1]});
  EXPECT_EQ(map.Parts(), (std::vector{part, PartId(0)})) << "the oldest first";
  EXPECT_TRUE(map.IsOrigin(keyframes[0]) && map.IsOrigin(keyframes[2]));
  EXPECT_EQ(map.PartOf(keyframes[1]), part);
  EXPECT_EQ(map.PartOf(keyframes[4]), PartId(0));
  EXPECT_EQ(map.landmarks().At(of_first).observations().size(), 2u);
  EXPECT_EQ(map.landmarks().At(of_second).observations().size(), 3u);
  EXPECT_EQ(map.PartOf(map.landmarks().At(mostly_first)), part);
  EXPECT_EQ(map.landmarks().At(mostly_first).observations().size(), 2u);
  EXPECT_EQ(map.PartOf(map.landmarks().At(mostly_second)), PartId(0));
  EXPECT_EQ(map.landmarks().At(mostly_second).observations().size(), 3u);
  EXPECT_FALSE(map.landmarks().Contains(of_neither)) << "one view is none";
  EXPECT_EQ(map.keyframes().At(keyframes[1]).WeightOf(keyframes[2]), 0);
  EXPECT_THAT(map.Validate(), IsEmpty());
}

TEST(MapTest, ACopyStaysAsItWas) {
  Map map = MakeMap();
  const KeyframeId a = AddKeyframe(&map, 10), b = AddKeyframe(&map, 10), gone = AddKeyframe(&map, 10);
  const LandmarkId id = map.AddLandmark({0, 0, 1}, a).id();
  map.Link(a, 0, id);
  map.Link(b, 0, id);
  map.EraseKeyframe(gone, b);
  const Map copy = map;
  map.SplitPart({a});
  map.keyframes().At(b).set_cam_from_world(Rigid3(Eigen::Quaterniond::Identity(), {1, 0, 0}));
  EXPECT_FALSE(map.landmarks().Contains(id));
  EXPECT_EQ(copy.Parts(), std::vector{PartId(0)});
  ASSERT_TRUE(copy.landmarks().Contains(id));
  EXPECT_EQ(copy.landmarks().At(id).observations().size(), 2u);
  EXPECT_EQ(copy.keyframes().At(b).CenterInWorld().norm(), 0);
  EXPECT_EQ(copy.keyframes().size(), 2u);
  EXPECT_EQ(copy.keyframes().CreatedCount(), 3u);
  EXPECT_EQ(copy.ResolveKeyframe(gone).keyframe, b);
  EXPECT_THAT(copy.Validate(), IsEmpty());
  EXPECT_THAT(map.Validate(), IsEmpty());
}

TEST(IdTable, WhatIsGoneStaysGoneAndTheOthersStay) {
  struct Value {
    explicit Value(LandmarkId id_in) : id(id_in) {}
    LandmarkId id;
  };
  IdTable<LandmarkId, Value> table;
  for (uint32_t i = 0; i < 200; ++i) EXPECT_EQ(table.Emplace().id, LandmarkId(i));
  const Value* const stays = table.Find(LandmarkId(130));
  for (uint32_t i = 0; i < 200; ++i) {
    if (i != 130) table.Erase(LandmarkId(i));
  }
  EXPECT_EQ(table.Emplace().id, LandmarkId(200));
  EXPECT_EQ(table.Find(LandmarkId(130)), stays);
  EXPECT_EQ(table.Find(LandmarkId(3)), nullptr);
  EXPECT_FALSE(table.Contains(LandmarkId(199)));
  std::vector<uint32_t> ids;
  table.ForEach([&](const Value& value) { ids.push_back(value.id.value()); });
  EXPECT_THAT(ids, testing::ElementsAre(130, 200));
  EXPECT_EQ(table.size(), 2u);
  EXPECT_EQ(table.CreatedCount(), 201u);
}

TEST(MergeLog, ForgetsTheMergesOfLongAgo) {
  MergeLog log;
  EXPECT_FALSE(log.Into(LandmarkId(5)).IsValid());
  log.Add(LandmarkId(5), LandmarkId(2));
  EXPECT_EQ(log.Into(LandmarkId(5)), LandmarkId(2));
  EXPECT_FALSE(log.Into(LandmarkId(5 + 32768)).IsValid());
  log.Add(LandmarkId(5 + 32768), LandmarkId(7));
  EXPECT_EQ(log.Into(LandmarkId(5 + 32768)), LandmarkId(7));
  EXPECT_FALSE(log.Into(LandmarkId(5)).IsValid());
}

}  // namespace
}  // namespace dynamic_slam
