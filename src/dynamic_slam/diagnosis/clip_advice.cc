#include "dynamic_slam/diagnosis/clip_advice.h"

#include <cmath>

#include <fmt/format.h>

namespace dynamic_slam {

std::vector<ClipAdvice> AdviseOnClip(const ClipMeasures& m,
                                     const std::optional<SelfCalibration>& calibration) {
  constexpr double kDarkGrey = 25, kBlackShare = 0.7, kWhiteShare = 0.3;
  constexpr double kBlurredPx = 4, kFewKeypoints = 0.4;
  constexpr double kStill = 0.003, kRotation = 0.9;
  // A map keeps what fits its camera: of a focal length that is a third off, this much is left to see.
  constexpr double kFocalGain = 0.03, kFocalChange = 0.04;
  constexpr double kReadoutGain = 0.03;  // of the rendered film of 30 ms it is 0.1, of a global shutter 0
  std::vector<ClipAdvice> advice;
  const auto advise = [&advice](ClipProblem problem, std::string text) {
    advice.push_back({problem, std::move(text)});
  };
  const bool is_dark = m.grey < kDarkGrey || m.dark_share > kBlackShare;
  if (is_dark) {
    advise(ClipProblem::kTooDark, fmt::format("The images are too dark: {:.0f} of 255 in the mean, {:.0f} % "
                                              "of the pixels are black. More light, "
                                              "a longer exposure or a higher gain; is the lens covered?",
                                              m.grey, 100 * m.dark_share));
  }
  if (m.bright_share > kWhiteShare) {
    advise(ClipProblem::kOverExposed,
           fmt::format(
               "The images are over-exposed: {:.0f} % of the pixels are white, and show nothing. A shorter "
               "exposure; automatic exposure on; no lamp or window in the view.",
               100 * m.bright_share));
  }
  if (m.edge_width_px > kBlurredPx) {
    advise(
        ClipProblem::kBlurred,
        fmt::format(
            "The images are blurred: edges are {:.1f} px wide. Focus the lens; with motion, more light and a "
            "shorter exposure, or move slower.",
            m.edge_width_px));
  }
  if (m.keypoints < kFewKeypoints * ClipMeasures::kWantedKeypoints) {
    advise(
        ClipProblem::kLittleTexture,
        fmt::format(
            "There is little to hold on to: {:.0f} of {} keypoints. Let the camera see things with patterns "
            "and corners, not blank walls; lower orb.fast_threshold_min.",
            m.keypoints, ClipMeasures::kWantedKeypoints));
  }
  if (!advice.empty()) return advice;  // motion cannot be measured in such images
  if (m.pairs == 0) {
    if (m.motion_share < kStill) {
      advise(
          ClipProblem::kNoMotion,
          fmt::format(
              "The camera does not move: points stay within {:.1f} % of the image's width. Move it sideways.",
              100 * m.motion_share));
    }
    return advice;
  }
  if (m.rotation_share > kRotation) {
    advise(ClipProblem::kOnlyRotation,
           fmt::format("The camera only turns: a rotation explains {:.0f} % of what moves, and depth cannot "
                       "be seen. Walk "
                       "with it; move it sideways while it looks at things that are near.",
                       100 * m.rotation_share));
  } else if (calibration.has_value() && calibration->focal_gain > kFocalGain &&
             std::abs(calibration->focal_factor - 1) > kFocalChange) {
    advise(
        ClipProblem::kCalibration,
        fmt::format(
            "The calibration does not seem to fit the images: with a {} focal length, errors of the map are "
            "{:.0f} % "
            "smaller. Check the camera file and the size of the images; `dynamic_slam calibrate` makes a new "
            "one.",
            calibration->focal_factor > 1 ? "longer" : "shorter", 100 * calibration->focal_gain));
  } else if (calibration.has_value() && calibration->readout_gain > kReadoutGain) {
    advise(
        ClipProblem::kRollingShutter,
        fmt::format("The shutter seems to roll: with readout_s: {:.3f} in the camera file, errors of the map "
                    "are {:.0f} % smaller.",
                    calibration->readout_s, 100 * calibration->readout_gain));
  } else if (calibration.has_value() && calibration->lens_gain > kNotableLensGain) {
    advise(
        ClipProblem::kLens,
        fmt::format("The lens seems to bend lines otherwise than the camera file says: with k1: {:.4f} and "
                    "k2: {:.4f} there, errors of the map are {:.0f} % smaller.",
                    calibration->k1, calibration->k2, 100 * calibration->lens_gain));
  }
  return advice;
}

}  // namespace dynamic_slam
