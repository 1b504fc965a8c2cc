#include "dynamic_slam/features/patch_alignment.h"

#include <cmath>

#include <Eigen/LU>

namespace dynamic_slam {
namespace {

constexpr int kWidth = 2 * Patch::kRadius + 1;
constexpr size_t kCount = kWidth * kWidth;

constexpr int kMaxSteps = 15;
constexpr float kLastStep_px = 0.02f;
// A corner that is found a second time is less than that away; a match that is farther off shows other
// things.
constexpr float kMaxShift_px = 3;
// Grey levels (rms) below which a patch is mostly the camera's noise, of one or two.
constexpr float kMinContrast = 4;
constexpr float kMinGain = 0.2f;
constexpr float kMinCorrelation = 0.8f;
// Determinant of the structure tensor over its squared trace: the smaller eigenvalue is a thousandth.
constexpr float kMinCornerness = 1e-3f;

using Values = std::array<float, kCount>;

// Of a Gaussian over the patch; their sum is 1.
const Values& Weights() {
  static const Values weights = [] {
    constexpr float kSigma_px = 0.7f * Patch::kRadius;
    Values values{};
    float sum = 0;
    for (size_t i = 0; i < kCount; ++i) {
      const auto x = static_cast<float>(static_cast<int>(i) % kWidth - Patch::kRadius);
      const auto y = static_cast<float>(static_cast<int>(i) / kWidth - Patch::kRadius);
      values[i] = std::exp(-(x * x + y * y) / (2 * kSigma_px * kSigma_px));
      sum += values[i];
    }
    for (float& value : values) value /= sum;
    return values;
  }();
  return weights;
}

float Dot(const Values& a, const Values& b) {
  const Values& weights = Weights();
  float sum = 0;
  for (size_t i = 0; i < kCount; ++i) sum += weights[i] * a[i] * b[i];
  return sum;
}

void SubtractMean(Values* values) {
  const Values& weights = Weights();
  float mean = 0;
  for (size_t i = 0; i < kCount; ++i) mean += weights[i] * (*values)[i];
  for (float& value : *values) value -= mean;
}

// Bilinear.
float Sample(const cv::Mat& level, float x, float y) {
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const float right_share = x - static_cast<float>(left), bottom_share = y - static_cast<float>(top);
  const uint8_t* above = level.ptr<uint8_t>(top) + left;
  const uint8_t* below = above + level.step[0];
  const auto between = [right_share](const uint8_t* p) {
    return static_cast<float>(p[0]) + right_share * static_cast<float>(p[1] - p[0]);
  };
  return between(above) + bottom_share * (between(below) - between(above));
}

bool IsInside(const cv::Mat& level, const Eigen::Vector2f& center, const Eigen::Vector2f& reach) {
  return center.x() - reach.x() >= 0 && center.y() - reach.y() >= 0 &&
         center.x() + reach.x() < static_cast<float>(level.cols - 1) &&
         center.y() + reach.y() < static_cast<float>(level.rows - 1);
}

// What the level shows where the patch's px go.
Values Look(const cv::Mat& level, const Eigen::Matrix2f& level_from_patch, const Eigen::Vector2f& center) {
  Values seen;
  size_t i = 0;
  for (int y = -Patch::kRadius; y <= Patch::kRadius; ++y) {
    const Eigen::Vector2f row = center + level_from_patch.col(1) * static_cast<float>(y);
    for (int x = -Patch::kRadius; x <= Patch::kRadius; ++x) {
      const Eigen::Vector2f px = row + level_from_patch.col(0) * static_cast<float>(x);
      seen[i++] = Sample(level, px.x(), px.y());
    }
  }
  return seen;
}

}  // namespace

std::optional<Patch> CutPatch(const cv::Mat& level, const Eigen::Vector2f& center) {
  constexpr int kReach = Patch::kRadius + 1;
  if (!IsInside(level, center, Eigen::Vector2f::Constant(kReach))) return std::nullopt;
  Patch patch;
  size_t i = 0;
  for (int y = -kReach; y <= kReach; ++y) {
    for (int x = -kReach; x <= kReach; ++x) {
      const Eigen::Vector2f px = center + Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y));
      patch.pixels[i++] = static_cast<uint8_t>(std::lround(Sample(level, px.x(), px.y())));
    }
  }
  return patch;
}

std::optional<Eigen::Vector2f> AlignPatch(const Patch& patch, const cv::Mat& level,
                                          const Eigen::Matrix2f& level_from_patch,
                                          const Eigen::Vector2f& start) {
  Values wanted, dx, dy;
  size_t i = 0;
  for (int y = 1; y <= kWidth; ++y) {
    for (int x = 1; x <= kWidth; ++x, ++i) {
      const uint8_t* at = patch.pixels.data() + y * Patch::kSize + x;
      wanted[i] = at[0];
      dx[i] = 0.5f * static_cast<float>(at[1] - at[-1]);
      dy[i] = 0.5f * static_cast<float>(at[Patch::kSize] - at[-Patch::kSize]);
    }
  }
  for (Values* values : {&wanted, &dx, &dy}) SubtractMean(values);
  const float variance = Dot(wanted, wanted);
  if (variance < kMinContrast * kMinContrast) return std::nullopt;
  Eigen::Matrix2f H;
  H << Dot(dx, dx), Dot(dx, dy), Dot(dx, dy), Dot(dy, dy);
  if (!(H.determinant() > kMinCornerness * H.trace() * H.trace())) return std::nullopt;
  const Eigen::Matrix2f H_inverse = H.inverse();

  const Eigen::Vector2f reach = Patch::kRadius * level_from_patch.cwiseAbs().rowwise().sum();
  Eigen::Vector2f center = start;
  for (int k = 0; k < kMaxSteps; ++k) {
    if (!IsInside(level, center, reach)) return std::nullopt;
    Values difference = Look(level, level_from_patch, center);
    SubtractMean(&difference);
    const float gain = Dot(difference, wanted) / variance;
    if (!(gain > kMinGain)) return std::nullopt;
    for (size_t j = 0; j < kCount; ++j) difference[j] = difference[j] / gain - wanted[j];
    const Eigen::Vector2f step = H_inverse * Eigen::Vector2f(Dot(dx, difference), Dot(dy, difference));
    center -= level_from_patch * step;
    if (!((center - start).norm() < kMaxShift_px)) return std::nullopt;
    if (step.norm() < kLastStep_px) {
      // The difference is orthogonal to the patch, so what was seen has this correlation with it.
      const float correlation = std::sqrt(variance / (variance + Dot(difference, difference)));
      return correlation >= kMinCorrelation ? std::optional(center) : std::nullopt;
    }
  }
  return std::nullopt;
}

}  // namespace dynamic_slam
