#include "dynamic_slam/features/fast_detector.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

inline uint8_t Min(uint8_t a, uint8_t b) { return a < b ? a : b; }
inline uint8_t Max(uint8_t a, uint8_t b) { return a > b ? a : b; }

// score[x] for x in [begin, end) of the row at `centre`.
DS_DISPATCH_AVX2
void ScoreRow(const uint8_t* __restrict centre, ptrdiff_t stride, int begin, int end,
              uint8_t* __restrict score) {
  const uint8_t *u3 = centre - 3 * stride, *u2 = centre - 2 * stride, *u1 = centre - stride;  // rows above
  const uint8_t *d1 = centre + stride, *d2 = centre + 2 * stride, *d3 = centre + 3 * stride;  // and below
  for (int x = begin; x < end; ++x) {
    // The circle, clockwise from the top.
    const uint8_t p0 = u3[x], p1 = u3[x + 1], p2 = u2[x + 2], p3 = u1[x + 3];
    const uint8_t p4 = centre[x + 3], p5 = d1[x + 3], p6 = d2[x + 2], p7 = d3[x + 1];
    const uint8_t p8 = d3[x], p9 = d3[x - 1], p10 = d2[x - 2], p11 = d1[x - 3];
    const uint8_t p12 = centre[x - 3], p13 = u1[x - 3], p14 = u2[x - 2], p15 = u3[x - 1];
    // The brightest minimum over 9 in a row. Two arcs of 9 share 8 pixels: min(shared 8, max(one end, other
    // end)). Eight pixels are four pairs (1,2) (3,4) ... (15,0).
    const uint8_t a1 = Min(p1, p2), a3 = Min(p3, p4), a5 = Min(p5, p6), a7 = Min(p7, p8);
    const uint8_t a9 = Min(p9, p10), a11 = Min(p11, p12), a13 = Min(p13, p14), a15 = Min(p15, p0);
    const uint8_t b1 = Min(a1, a3), b3 = Min(a3, a5), b5 = Min(a5, a7), b7 = Min(a7, a9);
    const uint8_t b9 = Min(a9, a11), b11 = Min(a11, a13), b13 = Min(a13, a15), b15 = Min(a15, a1);
    const uint8_t m1 = Min(Min(b1, b5), Max(p0, p9)), m3 = Min(Min(b3, b7), Max(p2, p11));
    const uint8_t m5 = Min(Min(b5, b9), Max(p4, p13)), m7 = Min(Min(b7, b11), Max(p6, p15));
    const uint8_t m9 = Min(Min(b9, b13), Max(p8, p1)), m11 = Min(Min(b11, b15), Max(p10, p3));
    const uint8_t m13 = Min(Min(b13, b1), Max(p12, p5)), m15 = Min(Min(b15, b3), Max(p14, p7));
    const uint8_t bright = Max(Max(Max(m1, m3), Max(m5, m7)), Max(Max(m9, m11), Max(m13, m15)));
    // The darkest maximum likewise.
    const uint8_t e1 = Max(p1, p2), e3 = Max(p3, p4), e5 = Max(p5, p6), e7 = Max(p7, p8);
    const uint8_t e9 = Max(p9, p10), e11 = Max(p11, p12), e13 = Max(p13, p14), e15 = Max(p15, p0);
    const uint8_t f1 = Max(e1, e3), f3 = Max(e3, e5), f5 = Max(e5, e7), f7 = Max(e7, e9);
    const uint8_t f9 = Max(e9, e11), f11 = Max(e11, e13), f13 = Max(e13, e15), f15 = Max(e15, e1);
    const uint8_t n1 = Max(Max(f1, f5), Min(p0, p9)), n3 = Max(Max(f3, f7), Min(p2, p11));
    const uint8_t n5 = Max(Max(f5, f9), Min(p4, p13)), n7 = Max(Max(f7, f11), Min(p6, p15));
    const uint8_t n9 = Max(Max(f9, f13), Min(p8, p1)), n11 = Max(Max(f11, f15), Min(p10, p3));
    const uint8_t n13 = Max(Max(f13, f1), Min(p12, p5)), n15 = Max(Max(f15, f3), Min(p14, p7));
    const uint8_t dark = Min(Min(Min(n1, n3), Min(n5, n7)), Min(Min(n9, n11), Min(n13, n15)));
    // max(bright - p, p - dark, 0) without leaving 8 bits.
    const uint8_t p = centre[x];
    const uint8_t over = static_cast<uint8_t>(Max(bright, p) - p);
    const uint8_t under = static_cast<uint8_t>(p - Min(dark, p));
    score[x] = Max(over, under);
  }
}

// marks[x] = 255 where the score of the middle row is above the threshold and a local maximum, else 0.
DS_DISPATCH_AVX2
void MarkMaxima(const uint8_t* __restrict above, const uint8_t* __restrict middle,
                const uint8_t* __restrict below, int begin, int end, uint8_t threshold,
                uint8_t* __restrict marks) {
  for (int x = begin; x < end; ++x) {
    const uint8_t before = Max(Max(above[x - 1], above[x]), Max(above[x + 1], middle[x - 1]));
    const uint8_t after = Max(Max(below[x - 1], below[x]), Max(below[x + 1], middle[x + 1]));
    const uint8_t exceed = Max(before, threshold);
    const uint8_t s = middle[x];
    marks[x] = static_cast<uint8_t>((s > exceed ? 255 : 0) & (s >= after ? 255 : 0));
  }
}

// Where the parabola through three values has its peak, the middle value being the largest; 0 on a plateau.
float Peak(int left, int middle, int right) {
  const int curvature = 2 * middle - left - right;
  if (curvature <= 0) return 0;
  return std::clamp(0.5f * static_cast<float>(right - left) / static_cast<float>(curvature), -0.5f, 0.5f);
}

// rows: the scores above, of and below row y.
Corner MakeCorner(const std::array<uint8_t*, 3>& rows, int x, int y) {
  // Smoothed across the axis looked at: the score is a minimum over pixels and rough. On rotated images this
  // halves the error of the position, compared with whole pixels.
  const auto column = [&](int i) { return rows[0][i] + 2 * rows[1][i] + rows[2][i]; };
  const auto row = [&](const uint8_t* scores) { return scores[x - 1] + 2 * scores[x] + scores[x + 1]; };
  return {static_cast<uint16_t>(x), static_cast<uint16_t>(y), Peak(column(x - 1), column(x), column(x + 1)),
          Peak(row(rows[0]), row(rows[1]), row(rows[2])), rows[1][x]};
}

}  // namespace

void FastDetector::Detect(const cv::Mat& image, int border, int threshold, std::vector<Corner>* corners) {
  DS_CHECK(image.type() == CV_8UC1 && border >= 4 && threshold >= 0 && threshold <= 255,
           "type={} border={} threshold={}", image.type(), border, threshold);
  DS_CHECK(image.cols <= UINT16_MAX && image.rows <= UINT16_MAX, "{}x{}", image.cols, image.rows);
  const int begin = border, end = image.cols - border;
  const int first_row = border, last_row = image.rows - border - 1;
  if (begin >= end || first_row > last_row) return;

  const size_t width = static_cast<size_t>(image.cols) + 8;
  if (rows_.size() < 4 * width) rows_.resize(4 * width);
  std::array<uint8_t*, 3> scores = {rows_.data(), rows_.data() + width, rows_.data() + 2 * width};
  uint8_t* const marks = rows_.data() + 3 * width;
  const auto score_row = [&](int y, uint8_t* score) {
    ScoreRow(image.ptr<uint8_t>(y), static_cast<ptrdiff_t>(image.step), begin - 1, end + 1, score);
  };
  score_row(first_row - 1, scores[0]);
  score_row(first_row, scores[1]);
  for (int y = first_row; y <= last_row; ++y) {
    score_row(y + 1, scores[2]);
    MarkMaxima(scores[0], scores[1], scores[2], begin, end, static_cast<uint8_t>(threshold), marks);
    std::memset(marks + end, 0, 8);  // the loop below looks at eight marks at a time
    for (int block = begin; block < end; block += 8) {
      uint64_t eight;
      std::memcpy(&eight, marks + block, 8);
      if constexpr (std::endian::native == std::endian::big) eight = __builtin_bswap64(eight);
      while (eight != 0) {  // byte by byte, the lowest first
        const int byte = std::countr_zero(eight) / 8;
        corners->push_back(MakeCorner(scores, block + byte, y));
        eight &= ~(uint64_t{255} << (8 * byte));
      }
    }
    std::swap(scores[0], scores[1]);
    std::swap(scores[1], scores[2]);
  }
}

}  // namespace dynamic_slam
