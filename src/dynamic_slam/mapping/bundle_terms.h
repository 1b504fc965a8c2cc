#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/landmark.h"
#include "dynamic_slam/optimize/bundle_adjustment.h"

namespace dynamic_slam {

// What bundle problems over the map have in common.

// What a pose saw of a landmark. pose, point: which they are in the problem; octave_scales: Map's.
BundleProblem::Observation ObservationOf(const FrameView::Sighting& sighting, const Landmark& landmark,
                                         std::span<const float> octave_scales, uint32_t pose, uint32_t point);

// How much the velocity of what carries a camera changes in a part of the map: the density of white noise of
// its acceleration, unit of the map^2/s^3; 0 where it is not known. is_in_camera: of the velocity as the
// camera has it, which turns with it, else as the world has it.
struct MotionNoise {
  double density = 0;
  bool is_in_camera = false;
};

using MotionNoises = std::map<PartId, MotionNoise>;

// Of velocities in the world or, where these change less, as a car's do in a curve, of those that the camera
// itself has. The largest of the shots' (ShotsOf).
MotionNoise NoiseOf(std::span<const std::span<const StampedPose>> shots);

// How the poses of a shot follow each other, as what carries a camera has mass. poses: which they are in the
// problem.
void AppendMotions(std::span<const StampedPose> shot, std::span<const uint32_t> poses,
                   const MotionNoise& noise, std::vector<BundleProblem::Motion>* motions);

}  // namespace dynamic_slam
