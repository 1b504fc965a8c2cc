#include "dynamic_slam/tracking/sighting_aligner.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/two_view_scene.h"
#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;

constexpr double kDepth = 4, kNoise_px = 0.7;

// A painted wall before cameras that move along it and towards it, and landmarks on it.
class SightingAlignerTest : public testing::Test {
 protected:
  SightingAlignerTest() {
    for (int y = 60; y < 440; y += 40) {
      for (int x = 80; x < 600; x += 40) points_.push_back(kDepth * camera_.Unproject({x, y}));
    }
    for (size_t i = 0; i < 5; ++i) keyframes_.push_back(AddKeyframe(PoseAt(static_cast<double>(i))));
    Map& map = *shared_map_.Write();
    for (uint32_t i = 0; i < points_.size(); ++i) {
      const LandmarkId id = map.AddLandmark(points_[i], keyframes_[0]).id();
      for (const KeyframeId keyframe : keyframes_) map.Link(keyframe, i, id);
      map.RefreshLandmark(id);
    }
  }

  static Rigid3 PoseAt(double i) {
    return Rigid3(Eigen::Quaterniond::Identity(), {-0.03 * i, 0.01 * i, -0.1 * i});
  }
  static double StampOf(double i) { return 0.1 * i; }

  cv::Mat Render(const Rigid3& cam_from_world, double phase = 0) const {
    cv::Mat image(camera_.height, camera_.width, CV_8UC1);
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const Eigen::Vector3d at = OnWall(cam_from_world, Eigen::Vector2d(x, y));
        const double a = 60 * at.x() + phase, b = 60 * at.y() + phase;
        image.at<uint8_t>(y, x) =
            cv::saturate_cast<uint8_t>(128 + 40 * std::sin(a + 0.3 * b) + 35 * std::cos(b - 0.4 * a) +
                                       15 * std::sin(0.5 * a) * std::sin(0.45 * b));
      }
    }
    return image;
  }
  Eigen::Vector3d OnWall(const Rigid3& cam_from_world, const Eigen::Vector2d& px) const {
    const Rigid3 world_from_cam = cam_from_world.Inverse();
    const Eigen::Vector3d ray = world_from_cam.rotation * camera_.Unproject(px);
    return world_from_cam.translation + ray * ((kDepth - world_from_cam.translation.z()) / ray.z());
  }

  Keypoint Seen(const Rigid3& cam_from_world, const Eigen::Vector3d& point) {
    const Eigen::Vector2d px = camera_.Project(cam_from_world * point);
    Keypoint keypoint;
    keypoint.x = keypoint.raw_x = static_cast<float>(px.x() + kNoise_px * random_.Gaussian());
    keypoint.y = keypoint.raw_y = static_cast<float>(px.y() + kNoise_px * random_.Gaussian());
    return keypoint;
  }
  KeyframeId AddKeyframe(const Rigid3& cam_from_world) {
    Frame frame;
    frame.id = FrameId(static_cast<uint32_t>(keyframes_.size()));
    frame.timestamp_s = StampOf(static_cast<double>(keyframes_.size()));
    frame.cam_from_world = cam_from_world;
    for (const Eigen::Vector3d& point : points_) {
      frame.features.keypoints.push_back(Seen(cam_from_world, point));
      frame.features.descriptors.push_back({random_.Next(), random_.Next(), random_.Next(), random_.Next()});
    }
    frame.grid.Build(frame.features, camera_.IdealBounds());
    frame.ClearLandmarks();
    return InsertKeyframe(frame, shared_map_.Write().get());
  }
  void KeepImages() {
    for (size_t i = 0; i < keyframes_.size(); ++i)
      aligner_.Keep(StampOf(static_cast<double>(i)), Render(PoseAt(static_cast<double>(i))));
  }
  // Where the camera would see what the reference, the keyframe in the middle, shows at its keypoint.
  Eigen::Vector2d Expected(const Rigid3& cam_from_world, uint32_t point) const {
    const Keyframe& reference = shared_map_.Read()->keyframes().At(keyframes_[2]);
    const Keypoint& keypoint = reference.keypoint(point);
    return camera_.Project(cam_from_world * OnWall(reference.cam_from_world(), {keypoint.x, keypoint.y}));
  }
  FrameView ViewAt(double i) {
    FrameView view{StampOf(i), PartId(0), PoseAt(i), {}};
    for (uint32_t k = 0; k < points_.size(); ++k) {
      const Keypoint keypoint = Seen(view.cam_from_world, points_[k]);
      view.sightings.push_back({LandmarkId(k), {keypoint.x, keypoint.y}, 0, 1, {keypoint.x, keypoint.y}});
    }
    return view;
  }

  Camera camera_ = TestCamera();
  Random random_{1};
  SharedMap shared_map_{SyntheticWorld::OctaveScales()};
  std::vector<Eigen::Vector3d> points_;
  std::vector<KeyframeId> keyframes_;
  SightingAligner aligner_{camera_, &shared_map_};
};

TEST_F(SightingAlignerTest, KeyframesSeeLandmarksWhereTheReferenceShowsThem) {
  KeepImages();
  std::vector<FrameView> views;
  const AlignedKeypoints aligned = aligner_.Align({}, {}, &views);
  ASSERT_EQ(aligned.size(), keyframes_.size());
  int found = 0, all = 0;
  for (const auto& [id, keypoints] : aligned) {
    for (uint32_t i = 0; i < keypoints.size(); ++i) {
      ++all;
      if (!(keypoints[i].sigma_px > 0)) continue;
      ++found;
      const Rigid3 pose = shared_map_.Read()->keyframes().At(id).cam_from_world();
      EXPECT_LT((keypoints[i].ideal_px.cast<double>() - Expected(pose, i)).norm(), 0.15)
          << id.value() << " " << i;
      EXPECT_LT(keypoints[i].sigma_px, kNoise_px);
    }
  }
  EXPECT_GT(found, 0.9 * all);
}

TEST_F(SightingAlignerTest, SoDoViewsAndThoseOfOtherImagesStay) {
  KeepImages();
  aligner_.Keep(StampOf(1.5), Render(PoseAt(1.5)));
  aligner_.Keep(StampOf(2.5), Render(PoseAt(2.5), 1.5));                // shows something else
  std::vector<FrameView> views{ViewAt(1.5), ViewAt(2.5), ViewAt(3.5)};  // no image of the last
  const std::vector<FrameView> before = views;
  aligner_.AlignViews({}, {}, &views);
  int found = 0;
  for (size_t i = 0; i < points_.size(); ++i) {
    const FrameView::Sighting& sighting = views[0].sightings[i];
    if (sighting.sigma_px > 0) {
      ++found;
      EXPECT_LT((sighting.ideal_px.cast<double>() - Expected(PoseAt(1.5), static_cast<uint32_t>(i))).norm(),
                0.15);
    }
    EXPECT_LT((sighting.raw_px - sighting.ideal_px).norm(), 1e-3) << "no distortion";
    EXPECT_EQ(views[2].sightings[i].ideal_px, before[2].sightings[i].ideal_px);
    EXPECT_EQ(views[2].sightings[i].sigma_px, 0);
  }
  EXPECT_GT(found, 0.9 * static_cast<double>(points_.size()));
  const auto is_found = [](const FrameView::Sighting& sighting) { return sighting.sigma_px > 0; };
  EXPECT_LT(std::count_if(views[1].sightings.begin(), views[1].sightings.end(), is_found),
            0.3 * static_cast<double>(points_.size()));
}

TEST_F(SightingAlignerTest, WhatARollingShutterAddedStays) {
  KeepImages();
  std::vector<FrameView> views{ViewAt(1)};
  const Eigen::Vector2f shift(2, -3);
  for (FrameView::Sighting& sighting : views[0].sightings) sighting.ideal_px += shift;
  aligner_.AlignViews({}, {}, &views);
  for (const FrameView::Sighting& sighting : views[0].sightings)
    EXPECT_LT((sighting.ideal_px - shift - sighting.raw_px).norm(), 1e-3);
}

TEST_F(SightingAlignerTest, WhatARollingShutterReadGoesToTheMiddleRowWhereThePathTellsHowItMoved) {
  Camera rolling = camera_;
  rolling.readout_s = 0.03;
  SightingAligner aligner(rolling, &shared_map_);
  Trajectory path;
  for (size_t i = 0; i < keyframes_.size(); ++i) {
    const auto at = static_cast<double>(i);
    aligner.Keep(StampOf(at), Render(PoseAt(at)));
    path.push_back({StampOf(at), PoseAt(at).Inverse()});
  }
  const SightingAligner::Motions motions{{PartId(0), MotionsAlong(path)}};
  ASSERT_TRUE(motions.at(PartId(0)).contains(StampOf(1)));
  const SteadyMotion& motion = motions.at(PartId(0)).at(StampOf(1));
  std::vector<FrameView> views{ViewAt(1)};
  const AlignedKeypoints aligned = aligner.Align(motions, {}, &views);
  int found = 0;
  double most = 0;
  for (uint32_t i = 0; i < points_.size(); ++i) {
    const FrameView::Sighting& of_view = views[0].sightings[i];
    const AlignedKeypoint& of_keyframe = aligned.at(keyframes_[1])[i];
    if (!(of_view.sigma_px > 0 && of_keyframe.sigma_px > 0)) continue;
    ++found;
    const Eigen::Vector2d read_px = Expected(PoseAt(1), i);
    const double depth = (PoseAt(1) * points_[i]).z();
    const Eigen::Vector2d px = AtMiddleRow(rolling, motion, read_px, read_px.y(), 1 / depth);
    most = std::max(most, (px - read_px).norm());
    EXPECT_LT((of_view.ideal_px.cast<double>() - px).norm(), 0.15) << i;
    EXPECT_LT((of_keyframe.ideal_px.cast<double>() - px).norm(), 0.15) << i;
    EXPECT_LT((of_view.raw_px.cast<double>() - read_px).norm(), 0.15) << i;
  }
  EXPECT_GT(found, 0.9 * static_cast<double>(points_.size()));
  EXPECT_GT(most, 0.5);
}

TEST_F(SightingAlignerTest, WithoutImagesOrWhenStoppedNothingChanges) {
  std::vector<FrameView> views{ViewAt(1)};
  const Eigen::Vector2f before = views[0].sightings[0].ideal_px;
  EXPECT_THAT(aligner_.Align({}, {}, &views), IsEmpty());
  KeepImages();
  EXPECT_THAT(aligner_.Align(
                  {}, [] { return true; }, &views),
              IsEmpty());
  aligner_.Clear();
  EXPECT_THAT(aligner_.Align({}, {}, &views), IsEmpty());
  EXPECT_EQ(views[0].sightings[0].ideal_px, before);
}

TEST(ImageArchiveTest, GivesBackWhatItGot) {
  ImageArchive archive;
  cv::RNG random(5);
  std::vector<cv::Mat> images;
  for (int i = 0; i < 7; ++i) {
    cv::Mat large(200, 330, CV_8UC1);
    random.fill(large, cv::RNG::UNIFORM, 0, 256);
    images.push_back(large(cv::Rect(3, 5, 311, 173)));  // rows are not next to each other
    archive.Keep(i, images.back());
  }
  cv::Mat read(173, 311, CV_8UC1);
  for (const int i : {6, 0, 3, 3, 1}) {
    ASSERT_TRUE(archive.Read(i, &read));
    EXPECT_EQ(cv::norm(read, images[static_cast<size_t>(i)], cv::NORM_INF), 0) << i;
  }
  EXPECT_FALSE(archive.Contains(2.5));
  EXPECT_FALSE(archive.Read(2.5, &read));
  archive.Clear();
  EXPECT_FALSE(archive.Read(3, &read));
}

TEST(ImageArchiveTest, WhereThereIsNoFileMemoryIsNotFilled) {
  const char* before = std::getenv("TMPDIR");
  const std::string old = before == nullptr ? "" : before;
  setenv("TMPDIR", "/proc/no_such_folder", 1);
  ImageArchive archive;
  const cv::Mat image(1000, 1000, CV_8UC1, cv::Scalar(7));
  for (int i = 0; i < 100; ++i) archive.Keep(i, image);
  if (before == nullptr) {
    unsetenv("TMPDIR");
  } else {
    setenv("TMPDIR", old.c_str(), 1);
  }
  EXPECT_TRUE(archive.Contains(25));
  EXPECT_FALSE(archive.Contains(40));
  EXPECT_FALSE(archive.Contains(99));
}

}  // namespace
}  // namespace dynamic_slam
