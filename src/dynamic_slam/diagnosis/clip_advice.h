#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/diagnosis/clip_measures.h"
#include "dynamic_slam/diagnosis/self_calibration.h"

namespace dynamic_slam {

enum class ClipProblem {
  kTooDark,
  kOverExposed,
  kBlurred,
  kLittleTexture,
  kNoMotion,
  kOnlyRotation,
  kCalibration,
  kRollingShutter,
  kLens
};

struct ClipAdvice {
  ClipProblem problem;
  std::string text;  // what is seen, with its number, and what to do
};

// What stands in the way of SLAM, the worst first: what hides the rest comes before it. Empty when nothing
// does. calibration: by a map of the clip, if there is one.
std::vector<ClipAdvice> AdviseOnClip(const ClipMeasures& measures,
                                     const std::optional<SelfCalibration>& calibration = {});

}  // namespace dynamic_slam
