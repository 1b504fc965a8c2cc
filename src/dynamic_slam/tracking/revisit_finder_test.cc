#include "dynamic_slam/tracking/revisit_finder.h"

#include <numbers>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;

constexpr uint32_t kPoints = 1500;

// By what a camera that came by again is off: some 5 px.
const Sim3 kSmallDrift{1.0, ExpSo3({0, 0.01, 0}), {0.01, 0.01, 0}};

// A camera that moves sideways past a world, turns away, and comes by again.
class RevisitFinderTest : public testing::Test {
 protected:
  static constexpr int kKeyframes = 6;  // of a visit

  void Visit(int visit, PartId part = PartId(0)) {
    for (int i = 0; i < kKeyframes; ++i)
      keyframes_[visit].push_back(scene_.Add(SidewaysPose(0.1 * (kKeyframes * visit + i)), part));
    scene_.AddLandmarks(0, kPoints, keyframes_[visit]);
  }

  void LookAway() {
    scene_.Add({Eigen::Quaterniond(ExpSo3({0, std::numbers::pi, 0})), Eigen::Vector3d::Zero()});
  }

  // The first points look the same to both visits.
  void VisitTwice(size_t same_points = kPoints) {
    Visit(0);
    LookAway();
    world_.Repaint(same_points);
    Visit(1);
  }

  void TurnEach(double step_rad) {
    for (const auto& of_visit : keyframes_) {
      for (int i = 0; i < kKeyframes; ++i) {
        Keyframe& keyframe = scene_.map.keyframes().At(of_visit[static_cast<size_t>(i)]);
        const Rigid3 turn(ExpSo3({0, step_rad * (i - kKeyframes / 2 + 0.5), 0}), Eigen::Vector3d::Zero());
        keyframe.set_cam_from_world(turn * keyframe.cam_from_world());
      }
    }
  }

  int LinkAll(bool stops = false) {
    return RevisitFinder(world_.camera(), TrackerOptions(), &scene_.shared_map).LinkAll([=] {
      return stops;
    });
  }

  // Landmarks that keyframes of both visits see.
  int InCommon() const {
    int common = 0;
    const std::set<KeyframeId> first(keyframes_[0].begin(), keyframes_[0].end());
    scene_.map.landmarks().ForEach([&](const Landmark& landmark) {
      size_t by_first = 0;
      for (const Observation& observation : landmark.observations())
        by_first += first.contains(observation.keyframe);
      common += by_first > 0 && by_first < landmark.observations().size();
    });
    return common;
  }

  // Landmarks that are the images of more than one point.
  int Mixed() const {
    int mixed = 0;
    scene_.map.landmarks().ForEach([&](const Landmark& landmark) {
      std::set<uint32_t> points;
      for (const Observation& observation : landmark.observations())
        points.insert(scene_.PointOf(observation));
      mixed += points.size() > 1;
    });
    return mixed;
  }

  SyntheticWorld world_{kPoints};
  SyntheticMap scene_{&world_};
  std::vector<KeyframeId> keyframes_[2];
};

TEST_F(RevisitFinderTest, WhatIsSeenAgainIsOne) {
  VisitTwice();
  scene_.Drift(keyframes_[1], kSmallDrift);
  ASSERT_EQ(InCommon(), 0);
  EXPECT_GT(LinkAll(), 300);
  EXPECT_GT(InCommon(), 300);
  EXPECT_LT(Mixed(), InCommon() / 20);
  EXPECT_THAT(scene_.map.Validate(), IsEmpty());
}

TEST_F(RevisitFinderTest, WhatWasInViewAllAlongIsLeftAsItIs) {
  // Landmarks of three keyframes each, every other point one later, so that all that follow each other have
  // some in common, and the first and the last none.
  for (int i = 0; i < kKeyframes; ++i) keyframes_[0].push_back(scene_.Add(SidewaysPose(0.1 * i)));
  const std::vector<KeyframeId>& all = keyframes_[0];
  for (uint32_t point = 0; point < kPoints; ++point) {
    const size_t first = point % 2;
    scene_.AddLandmark(point, {all[first], all[first + 1], all[first + 2]});
    scene_.AddLandmark(point, std::vector<KeyframeId>(all.begin() + static_cast<long>(first) + 3, all.end()));
  }
  EXPECT_EQ(LinkAll(), 0);
}

TEST_F(RevisitFinderTest, WhereTrackingWasLostIsAnotherTime) {
  Visit(0);
  Visit(1);
  EXPECT_GT(LinkAll(), 300);
}

TEST_F(RevisitFinderTest, OtherThingsInTheSamePlaceAreNotLinked) {
  VisitTwice(0);
  EXPECT_EQ(LinkAll(), 0);
}

TEST_F(RevisitFinderTest, OtherPartsOfTheMapAreNotLinked) {
  Visit(0, scene_.map.BeginPart());
  Visit(1, scene_.map.BeginPart());
  EXPECT_EQ(LinkAll(), 0);
}

TEST_F(RevisitFinderTest, FewAreBelievedWhereAKeyframeBesideSaysTheSame) {
  VisitTwice(60);
  EXPECT_GT(LinkAll(), 20);
  EXPECT_GT(InCommon(), 20);
}

TEST_F(RevisitFinderTest, FewAreNotBelievedWhereEachSaysSomethingElse) {
  VisitTwice(60);
  TurnEach(0.01);
  EXPECT_EQ(LinkAll(), 0);
}

TEST_F(RevisitFinderTest, WhatMovesMoreLikelyThanNotIsNotLinked) {
  VisitTwice();
  const auto set_static_probability = [&](float probability) {
    for (const auto& of_visit : keyframes_) {
      for (const KeyframeId id : of_visit) {
        Keyframe& keyframe = scene_.map.keyframes().At(id);
        keyframe.set_static_probability(std::vector<float>(keyframe.features().size(), probability));
      }
    }
  };
  set_static_probability(0.4f);
  EXPECT_EQ(LinkAll(), 0);
  set_static_probability(0.9f);
  EXPECT_GT(LinkAll(), 300);
}

TEST_F(RevisitFinderTest, StopsWhenAsked) {
  VisitTwice();
  EXPECT_EQ(LinkAll(true), 0);
  EXPECT_EQ(InCommon(), 0);
}

}  // namespace
}  // namespace dynamic_slam
