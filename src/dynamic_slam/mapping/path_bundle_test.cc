#include "dynamic_slam/mapping/path_bundle.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

constexpr double kInterval_s = 1.0 / 30, kSpeed = 0.3, kNoise_px = 2;

// A camera that goes sideways at a steady pace through a map that is exact, and sees little of it.
class PathBundleTest : public testing::Test {
 protected:
  PathBundleTest() {
    for (const double x : {0.0, 2.0, 4.0}) keyframes_.push_back(scene_.Add(SidewaysPose(x)));
    scene_.AddLandmarks(0, kPoints, keyframes_);
    landmark_of_.resize(kPoints);
    scene_.map.landmarks().ForEach([this](const Landmark& landmark) {
      const Observation& observation = landmark.observations().front();
      landmark_of_[scene_.views[observation.keyframe.value()].points[observation.keypoint]] = landmark.id();
    });
  }

  static double XOf(size_t frame) { return kSpeed * kInterval_s * static_cast<double>(frame); }

  // away: of each frame, by how much it looks farther along the way than it is.
  std::vector<FrameView> See(size_t frames, const std::function<double(size_t)>& away = {}) {
    std::vector<FrameView> views;
    for (size_t i = 0; i < frames; ++i) {
      const Rigid3 pose = SidewaysPose(XOf(i) + (away ? away(i) : 0));
      const SyntheticView seen = world_.See(pose);
      FrameView view{kInterval_s * static_cast<double>(i), PartId(0), pose, {}};
      for (size_t k = 0; k < seen.points.size(); ++k) {
        const Keypoint& keypoint = seen.frame.features.keypoints[k];
        const LandmarkId landmark = landmark_of_[seen.points[k]];
        if (landmark.IsValid())
          view.sightings.push_back({landmark, {keypoint.x, keypoint.y}, keypoint.octave, 1});
      }
      views.push_back(std::move(view));
    }
    return views;
  }

  void Adjust(std::vector<FrameView>* views, const MotionNoises& noises = {}) {
    BundleOptions thorough;
    thorough.max_iterations = thorough.refine_iterations = 100;
    thorough.function_tolerance = 1e-10;
    thorough.reject_outliers = false;  // some would be outliers just where a piece begins
    AdjustPath(world_.camera(), thorough, noises, {}, &scene_.shared_map, views);
  }

  static Eigen::Vector3d CentreOf(const FrameView& view) {
    return view.cam_from_world.TargetOriginInSource();
  }
  static double ErrorOf(const FrameView& view) {
    return (CentreOf(view) - Eigen::Vector3d(kSpeed * view.timestamp_s, 0, 0)).norm();
  }
  static double Rmse(const std::vector<FrameView>& views) {
    double squares = 0;
    for (const FrameView& view : views) squares += ErrorOf(view) * ErrorOf(view);
    return std::sqrt(squares / static_cast<double>(views.size()));
  }

  static constexpr uint32_t kPoints = 300;
  // As if the camera could be anywhere at any time.
  const MotionNoises massless_{{PartId(0), {1e12, false}}};
  const MotionNoises steady_{{PartId(0), {0.01, false}}};
  SyntheticWorld world_{kPoints, kNoise_px};
  SyntheticMap scene_{&world_};
  std::vector<KeyframeId> keyframes_;
  std::vector<LandmarkId> landmark_of_;
};

TEST_F(PathBundleTest, WhatCarriesACameraHasMass) {
  std::vector<FrameView> each_for_itself = See(120), path = each_for_itself;
  Adjust(&each_for_itself, massless_);
  const std::vector<FrameView> before = each_for_itself;
  path = before;
  Adjust(&path);  // as the path itself says
  EXPECT_LT(Rmse(path), 0.6 * Rmse(before)) << Rmse(before);
}

// Some frames see little but somebody who moves off, and then the room again.
TEST_F(PathBundleTest, ABulgeIsPulledBack) {
  const auto astray = [](size_t i) { return i >= 60 && i < 66 ? 0.02 * static_cast<double>(i - 59) : 0.0; };
  std::vector<FrameView> views = See(120, astray);
  Adjust(&views, massless_);
  const auto worst = [&] {
    double error = 0;
    for (size_t i = 60; i < 66; ++i) error = std::max(error, ErrorOf(views[i]));
    return error;
  };
  const double before = worst();
  ASSERT_GT(before, 0.08);
  Adjust(&views, steady_);
  EXPECT_LT(worst(), 0.5 * before);
}

TEST_F(PathBundleTest, AFilmThatWasCutStaysSo) {
  const auto away = [](size_t i) { return i >= 60 ? 1.5 : 0.0; };
  std::vector<FrameView> views = See(120, away);
  Adjust(&views, steady_);
  for (size_t i = 0; i < views.size(); ++i) {
    EXPECT_LT((CentreOf(views[i]) - Eigen::Vector3d(XOf(i) + away(i), 0, 0)).norm(), 0.02) << i;
  }
}

// A long path is adjusted in pieces; nobody sees where one ends.
TEST_F(PathBundleTest, WhereAPieceEndsMakesNoDifference) {
  std::vector<FrameView> whole = See(400);
  Adjust(&whole, massless_);
  std::vector<FrameView> later(whole.begin() + 70, whole.end());
  Adjust(&whole, steady_);
  Adjust(&later, steady_);
  for (size_t i = 60; i < later.size(); ++i) {
    EXPECT_LT((CentreOf(later[i]) - CentreOf(whole[i + 70])).norm(), 0.05 * Rmse(whole)) << i;
  }
}

TEST_F(PathBundleTest, PartsOfTheMapHaveAPathEach) {
  std::vector<FrameView> one = See(120), both = one;
  for (const FrameView& view : See(120, [](size_t) { return 1.5; })) {
    both.push_back(view);
    both.back().part = PartId(1);
    both.back().timestamp_s += 0.5 * kInterval_s;
  }
  std::stable_sort(both.begin(), both.end(),
                   [](const FrameView& a, const FrameView& b) { return a.timestamp_s < b.timestamp_s; });
  Adjust(&one);
  Adjust(&both);
  for (size_t i = 0; i < one.size(); ++i) EXPECT_EQ(CentreOf(both[2 * i]), CentreOf(one[i])) << i;
}

TEST_F(PathBundleTest, WhatSeesNextToNothingStays) {
  std::vector<FrameView> views = See(30);
  for (FrameView& view : views) {
    std::erase_if(view.sightings,
                  [&](const FrameView::Sighting& sighting) { return sighting.landmark.value() > 1; });
  }
  const std::vector<FrameView> before = views;
  Adjust(&views, steady_);
  for (size_t i = 0; i < views.size(); ++i) EXPECT_EQ(CentreOf(views[i]), CentreOf(before[i]));
}

TEST_F(PathBundleTest, StopsWhenItIsTold) {
  std::vector<FrameView> views = See(120);
  const std::vector<FrameView> before = views;
  AdjustPath(
      world_.camera(), BundleOptions(), steady_, [] { return true; }, &scene_.shared_map, &views);
  for (size_t i = 0; i < views.size(); ++i) EXPECT_EQ(CentreOf(views[i]), CentreOf(before[i]));
}

}  // namespace
}  // namespace dynamic_slam
