#include "dynamic_slam/features/smoothing.h"

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/features/multiversion.h"

namespace dynamic_slam {
namespace {

// out[x] = weighted sum of taps[0][x] ... taps[6][x], x in [0, count). All sums fit 16 bits.
DS_MULTIVERSION
void WeightSeven(const std::array<const uint8_t*, 7>& taps, const SmoothingKernel& kernel, int count,
                 uint8_t* __restrict out) {
  const uint8_t *a3 = taps[0], *a2 = taps[1], *a1 = taps[2], *m = taps[3], *b1 = taps[4], *b2 = taps[5],
                *b3 = taps[6];
  const uint16_t k0 = kernel[0], k1 = kernel[1], k2 = kernel[2], k3 = kernel[3];
  for (int x = 0; x < count; ++x) {
    const uint16_t sum1 = static_cast<uint16_t>(a1[x] + b1[x]);
    const uint16_t sum2 = static_cast<uint16_t>(a2[x] + b2[x]);
    const uint16_t sum3 = static_cast<uint16_t>(a3[x] + b3[x]);
    const uint16_t sum = static_cast<uint16_t>(m[x] * k0 + sum1 * k1 + sum2 * k2 + sum3 * k3 + 128);
    out[x] = static_cast<uint8_t>(sum >> 8);
  }
}

}  // namespace

void Smooth(const cv::Mat& in, const SmoothingKernel& kernel, cv::Mat* out, std::vector<uint8_t>* row) {
  DS_CHECK(in.size() == out->size() && in.type() == CV_8UC1 && out->type() == CV_8UC1, "{}x{} {}x{}", in.cols,
           in.rows, out->cols, out->rows);
  if (in.cols < 7 || in.rows < 7) return;
  if (row->size() < static_cast<size_t>(in.cols)) row->resize(in.cols);
  const uint8_t* r = row->data();
  for (int y = 3; y < in.rows - 3; ++y) {
    WeightSeven(
        {in.ptr(y - 3), in.ptr(y - 2), in.ptr(y - 1), in.ptr(y), in.ptr(y + 1), in.ptr(y + 2), in.ptr(y + 3)},
        kernel, in.cols, row->data());
    WeightSeven({r, r + 1, r + 2, r + 3, r + 4, r + 5, r + 6}, kernel, in.cols - 6, out->ptr(y) + 3);
  }
}

}  // namespace dynamic_slam
