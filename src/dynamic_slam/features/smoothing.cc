#include "dynamic_slam/features/smoothing.h"

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

inline uint8_t Average(uint8_t a, uint8_t b) { return static_cast<uint8_t>((a + b + 1) >> 1); }

// out[x] = the kernel over a[x], b[x], c[x], d[x], e[x].
using Filter = void (*)(const uint8_t* a, const uint8_t* b, const uint8_t* c, const uint8_t* d,
                        const uint8_t* e, int count, uint8_t* out);

DS_DISPATCH_AVX2
void Fine(const uint8_t* a, const uint8_t* b, const uint8_t* c, const uint8_t* d, const uint8_t* e, int count,
          uint8_t* __restrict out) {
  for (int x = 0; x < count; ++x) {
    // 1 2 1 over three values of 1 2 1.
    const uint8_t left = Average(Average(a[x], c[x]), b[x]);
    const uint8_t middle = Average(Average(b[x], d[x]), c[x]);
    const uint8_t right = Average(Average(c[x], e[x]), d[x]);
    out[x] = Average(Average(left, right), middle);
  }
}

DS_DISPATCH_AVX2
void Coarse(const uint8_t* a, const uint8_t*, const uint8_t* c, const uint8_t*, const uint8_t* e, int count,
            uint8_t* __restrict out) {
  for (int x = 0; x < count; ++x) out[x] = Average(Average(a[x], e[x]), c[x]);
}

void Convolve(const cv::Mat& in, Filter filter, cv::Mat* out, std::vector<uint8_t>* row) {
  DS_CHECK(in.size() == out->size() && in.type() == CV_8UC1 && out->type() == CV_8UC1 && in.data != out->data,
           "{}x{} {}x{}", in.cols, in.rows, out->cols, out->rows);
  if (in.cols < 5 || in.rows < 5) return;
  if (row->size() < static_cast<size_t>(in.cols)) row->resize(in.cols);
  uint8_t* const r = row->data();
  for (int y = 2; y < in.rows - 2; ++y) {
    filter(in.ptr(y - 2), in.ptr(y - 1), in.ptr(y), in.ptr(y + 1), in.ptr(y + 2), in.cols, r);
    filter(r, r + 1, r + 2, r + 3, r + 4, in.cols - 4, out->ptr(y) + 2);
  }
}

}  // namespace

void Smooth(const cv::Mat& in, cv::Mat* out, std::vector<uint8_t>* row) { Convolve(in, Fine, out, row); }

void SmoothMore(const cv::Mat& in, cv::Mat* out, std::vector<uint8_t>* row) {
  Convolve(in, Coarse, out, row);
}

}  // namespace dynamic_slam
