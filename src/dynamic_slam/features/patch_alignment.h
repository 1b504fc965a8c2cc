#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

// What an image shows about a point, in px of a level of its pyramid.
struct Patch {
  // With 3, 4, 5 and 7 px the median errors of landmarks in fr1_desk are 0.50, 0.46, 0.43 and 0.42 px.
  static constexpr int kRadius = 5;
  static constexpr int kSize = 2 * kRadius + 3;  // with a border, for the gradient
  std::array<uint8_t, kSize * kSize> pixels{};   // row by row
};

// level: CV_8UC1. center: px of the level. None where the patch would reach out of the image.
std::optional<Patch> CutPatch(const cv::Mat& level, const Eigen::Vector2f& center);

// Where near `start`, px of the level, it shows the patch: to a fraction of a px, whatever brightness and
// contrast, by the inverse compositional method (Baker and Matthews, "Lucas-Kanade 20 years on", 2004).
// level_from_patch: where the patch's px go. None where it does not show it, or the patch has no corner.
std::optional<Eigen::Vector2f> AlignPatch(const Patch& patch, const cv::Mat& level,
                                          const Eigen::Matrix2f& level_from_patch,
                                          const Eigen::Vector2f& start);

}  // namespace dynamic_slam
