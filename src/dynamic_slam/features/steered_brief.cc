#include "dynamic_slam/features/steered_brief.h"

#include <cmath>
#include <numbers>

#include "dynamic_slam/base/dispatch.h"

namespace dynamic_slam {
namespace {

constexpr int kPatchRadius = 15;  // px, of the orientation
constexpr int kRowPixels = 32;    // a row of the patch, and one more

// For each row of the patch 1 within the circle, else 0; and the same times the horizontal offset.
struct CircleWeights {
  std::array<std::array<int16_t, kRowPixels>, 2 * kPatchRadius + 1> inside{}, x{};
};

constexpr CircleWeights MakeCircleWeights() {
  CircleWeights weights;
  for (int v = -kPatchRadius; v <= kPatchRadius; ++v) {
    for (int u = -kPatchRadius; u <= kPatchRadius; ++u) {
      // A radius of 15.5 makes the circle as wide as the patch.
      if (4 * (u * u + v * v) > 31 * 31) continue;
      weights.inside[v + kPatchRadius][u + kPatchRadius] = 1;
      weights.x[v + kPatchRadius][u + kPatchRadius] = static_cast<int16_t>(u);
    }
  }
  return weights;
}

constexpr CircleWeights kCircle = MakeCircleWeights();

// First moments of the patch whose top left pixel is given.
DS_DISPATCH_AVX2
void Moments(const uint8_t* __restrict patch, ptrdiff_t stride, int* moment_x, int* moment_y) {
  int sum_x = 0, sum_y = 0;
  for (int row = 0; row <= 2 * kPatchRadius; ++row, patch += stride) {
    const int16_t* inside = kCircle.inside[row].data();
    const int16_t* weight = kCircle.x[row].data();
    int row_sum = 0;
    for (int i = 0; i < kRowPixels; ++i) {
      const int16_t pixel = patch[i];
      row_sum += pixel * inside[i];
      sum_x += pixel * weight[i];
    }
    sum_y += (row - kPatchRadius) * row_sum;
  }
  *moment_x = sum_x;
  *moment_y = sum_y;
}

// {x, y} of the first point and of the second of each test, px, at most 15 px from the keypoint: within
// kBorder that leaves the 4 px at the edge that smoothing does not reach.
constexpr std::array<std::array<int8_t, 4>, 256> kTestPoints = {{
#include "dynamic_slam/features/orb_tests.inc"
}};

}  // namespace

SteeredBrief::SteeredBrief(ptrdiff_t stride) : offsets_(kAngles) {
  for (int test = 0; test < kTests; ++test) {
    const std::array<int8_t, 4>& point = kTestPoints[test];
    for (int k = 0; k < kAngles; ++k) {
      const double angle = 2 * std::numbers::pi * k / kAngles;
      const double c = std::cos(angle), s = std::sin(angle);
      const auto offset = [&](double x, double y) {
        return static_cast<int32_t>(std::lround(s * x + c * y) * stride + std::lround(c * x - s * y));
      };
      offsets_[k].first[test] = offset(point[0], point[1]);
      offsets_[k].second[test] = offset(point[2], point[3]);
    }
  }
}

float SteeredBrief::Angle(const cv::Mat& image, int x, int y) {
  int moment_x, moment_y;
  Moments(image.ptr<uint8_t>(y - kPatchRadius) + (x - kPatchRadius), static_cast<ptrdiff_t>(image.step),
          &moment_x, &moment_y);
  return std::atan2(static_cast<float>(moment_y), static_cast<float>(moment_x));
}

Descriptor SteeredBrief::Describe(const uint8_t* centre, float angle_rad) const {
  const int turns = static_cast<int>(std::lround(angle_rad * (kAngles / (2 * std::numbers::pi_v<float>))));
  const Offsets& offsets = offsets_[static_cast<unsigned>(turns) % kAngles];
  const auto is_darker = [&](int test) -> uint64_t {
    return centre[offsets.first[test]] < centre[offsets.second[test]];
  };
  // The processor adds a comparison to twice a word in one step; four words at a time, as each waits for its
  // last step.
  uint64_t a = 0, b = 0, c = 0, d = 0;
  for (int i = 63; i >= 0; --i) {
    a = 2 * a + is_darker(i);
    b = 2 * b + is_darker(64 + i);
    c = 2 * c + is_darker(128 + i);
    d = 2 * d + is_darker(192 + i);
  }
  return {a, b, c, d};
}

}  // namespace dynamic_slam
