#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rolling_shutter.h"
#include "dynamic_slam/geometry/sim3.h"
#include "dynamic_slam/geometry/two_view_scene.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/shared_map.h"

namespace dynamic_slam {

// What a camera sees from somewhere: keypoint i is the image of points[i].
struct SyntheticView {
  Frame frame;  // cam_from_world is exact; no landmarks
  std::vector<uint32_t> points;
};

// A world of points with descriptors, in front of a camera at the origin, for tests of tracking and mapping
// without images.
class SyntheticWorld {
 public:
  static constexpr int kOctaves = 8;

  explicit SyntheticWorld(int points, double noise_px = 0.3) : noise_px_(noise_px), random_(1) {
    for (int i = 0; i < points; ++i) {
      const double y = random_.Uniform(-100, 580), x = random_.Uniform(-200, 840);
      const Eigen::Vector2d px(x, y);
      positions_.push_back(random_.Uniform(3, 7) * camera_.Unproject(px));
      descriptors_.push_back({random_.Next(), random_.Next(), random_.Next(), random_.Next()});
      angles_rad_.push_back(random_.Uniform(-3, 3));
      max_distances_.push_back(random_.Uniform(8, 16));
    }
  }

  static std::vector<float> OctaveScales() {
    std::vector<float> scales{1.0f};
    while (scales.size() < kOctaves) scales.push_back(1.2f * scales.back());
    return scales;
  }

  // Keypoints are noisy, and a few bits of their descriptors differ from view to view. A rolling shutter
  // (SetReadout) sees the motion: to first order, which is enough where views move by little.
  SyntheticView See(const Rigid3& cam_from_world, const SteadyMotion& motion = {}) {
    SyntheticView view;
    view.frame.id = FrameId(frames_);
    view.frame.timestamp_s = frames_++;
    view.frame.cam_from_world = cam_from_world;
    for (uint32_t i = 0; i < positions_.size(); ++i) {
      const Eigen::Vector3d x_in_cam = cam_from_world * positions_[i];
      if (!IsSeen(camera_, x_in_cam)) continue;
      const double octave = std::log(max_distances_[i] / x_in_cam.norm()) / std::log(1.2);
      Keypoint keypoint;
      keypoint.octave = std::clamp(static_cast<int>(std::lround(octave)), 0, kOctaves - 1);
      const double row_s = (camera_.Project(x_in_cam).y() / (camera_.height - 1) - 0.5) * camera_.readout_s;
      const Eigen::Vector2d px =
          camera_.Project(x_in_cam + row_s * (motion.angular_rad_s.cross(x_in_cam) + motion.linear_per_s)) +
          Noise(noise_px_ * OctaveScales()[static_cast<size_t>(keypoint.octave)], random_);
      keypoint.x = keypoint.raw_x = static_cast<float>(px.x());
      keypoint.y = keypoint.raw_y = static_cast<float>(px.y());
      keypoint.angle_rad = static_cast<float>(angles_rad_[i] + 0.05 * random_.Gaussian());
      Descriptor descriptor = descriptors_[i];
      for (int bit = 0; bit < 10; ++bit) descriptor[random_.Index(4)] ^= 1ULL << random_.Index(64);
      view.frame.features.keypoints.push_back(keypoint);
      view.frame.features.descriptors.push_back(descriptor);
      view.points.push_back(i);
    }
    view.frame.grid.Build(view.frame.features, camera_.IdealBounds());
    view.frame.ClearLandmarks();
    return view;
  }

  // Points from this one on look different from now on.
  void Repaint(size_t first) {
    for (size_t i = first; i < descriptors_.size(); ++i) {
      descriptors_[i] = {random_.Next(), random_.Next(), random_.Next(), random_.Next()};
    }
  }

  void SetReadout(double readout_s) { camera_.readout_s = readout_s; }

  const Camera& camera() const { return camera_; }
  const Eigen::Vector3d& position(uint32_t point) const { return positions_[point]; }
  size_t size() const { return positions_.size(); }

 private:
  Camera camera_ = TestCamera();
  double noise_px_;
  Random random_;
  uint32_t frames_ = 0;
  std::vector<Eigen::Vector3d> positions_;
  std::vector<Descriptor> descriptors_;
  std::vector<double> angles_rad_, max_distances_;
};

// A map of a synthetic world.
class SyntheticMap {
 public:
  explicit SyntheticMap(SyntheticWorld* world)
      : shared_map(SyntheticWorld::OctaveScales()), map(*shared_map.Write()), world_(world) {}

  // A keyframe at the pose that sees no landmark yet. Its keypoints beyond a column of the image count as
  // moving.
  KeyframeId Add(const Rigid3& cam_from_world, PartId part = PartId(0), float movers_from_px = 1e6f) {
    views.push_back(world_->See(cam_from_world));
    Frame& frame = views.back().frame;
    for (const Keypoint& keypoint : frame.features.keypoints) {
      frame.static_probability.push_back(keypoint.x < movers_from_px ? 1.0f : 0.0f);
    }
    return InsertKeyframe(views.back().frame, &map, part);
  }

  // A landmark at the point's true position, linked to those of the keyframes in which the point shows. Not
  // valid when these are fewer than two.
  LandmarkId AddLandmark(uint32_t point, const std::vector<KeyframeId>& keyframes) {
    std::vector<Observation> observations;
    for (const KeyframeId keyframe : keyframes) {
      const std::vector<uint32_t>& points = views[keyframe.value()].points;
      const auto found = std::find(points.begin(), points.end(), point);
      if (found != points.end())
        observations.push_back({keyframe, static_cast<uint32_t>(found - points.begin())});
    }
    if (observations.size() < 2) return LandmarkId();
    const LandmarkId id = map.AddLandmark(world_->position(point), keyframes.back()).id();
    for (const Observation& observation : observations)
      map.Link(observation.keyframe, observation.keypoint, id);
    map.RefreshLandmark(id);
    return id;
  }

  // Landmarks for the points first, ..., last - 1; returns their number.
  int AddLandmarks(uint32_t first, uint32_t last, const std::vector<KeyframeId>& keyframes) {
    int added = 0;
    for (uint32_t point = first; point < last; ++point) added += AddLandmark(point, keyframes).IsValid();
    return added;
  }

  // Keyframes, and the landmarks that the last of them made, as they look from a world that has drifted.
  void Drift(const std::vector<KeyframeId>& keyframes, const Sim3& drifted_from_world) {
    map.landmarks().ForEach([&](Landmark& landmark) {
      if (landmark.created_by() == keyframes.back()) landmark.Transform(drifted_from_world);
    });
    for (const KeyframeId id : keyframes) {
      Keyframe& keyframe = map.keyframes().At(id);
      keyframe.set_cam_from_world(ToRigid3(ToSim3(keyframe.cam_from_world()) * drifted_from_world.Inverse()));
    }
  }

  // The point that the observed keypoint is the image of.
  uint32_t PointOf(const Observation& observation) const {
    return views[observation.keyframe.value()].points[observation.keypoint];
  }

  SharedMap shared_map;
  Map& map;                          // without its lock: a test has one thread
  std::vector<SyntheticView> views;  // by keyframe id

 private:
  SyntheticWorld* world_;
};

inline const Sim3 kDrift{1.25, ExpSo3({0, 0.1, 0.02}), {0.3, 0.1, -0.2}};

// The camera at (x, 0, 0), looking along z.
inline Rigid3 SidewaysPose(double x) { return {Eigen::Quaterniond::Identity(), {-x, 0, 0}}; }

}  // namespace dynamic_slam
