#include "dynamic_slam/features/downscaler.h"

#include <algorithm>
#include <cmath>
#include <utility>

#ifdef __x86_64__
#include <immintrin.h>
#endif

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

constexpr int kOneBits = 11, kOne = 1 << kOneBits;  // weights are fixed-point numbers, as OpenCV's

// The weighted mean of two rows that were scaled already, rounded as OpenCV does it in 16 bits.
DS_DISPATCH_AVX2
void MixRows(const int32_t* __restrict first, const int32_t* __restrict second, int weight_first,
             int weight_second, int count, uint8_t* __restrict out) {
  for (int x = 0; x < count; ++x) {
    const int sum = ((weight_first * (first[x] >> 4)) >> 16) + ((weight_second * (second[x] >> 4)) >> 16);
    out[x] = static_cast<uint8_t>((sum + 2) >> 2);
  }
}

bool CanShuffle() {
#if defined(__x86_64__) && defined(__GNUC__)
  static const bool can = __builtin_cpu_supports("ssse3") > 0;
  return can;
#else
  return false;
#endif
}

}  // namespace

std::vector<Downscaler::Tap> Downscaler::MakeTaps(int from, int to) {
  std::vector<Tap> taps(static_cast<size_t>(to));
  const double scale = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    // Centres of pixels are at whole numbers, and the image begins at -0.5.
    const float at = static_cast<float>((i + 0.5) * scale - 0.5);
    int first = static_cast<int>(std::floor(at));
    float share = at - static_cast<float>(first);
    if (first < 0) first = 0, share = 0;
    if (first >= from - 1) first = from - 1, share = 0;
    taps[static_cast<size_t>(i)] = {first, std::min(first + 1, from - 1),
                                    static_cast<int16_t>(std::lrint((1.0f - share) * kOne)),
                                    static_cast<int16_t>(std::lrint(share * kOne))};
  }
  return taps;
}

Downscaler::Downscaler(cv::Size from, cv::Size to)
    : from_(from),
      to_(to),
      columns_(MakeTaps(from.width, to.width)),
      rows_(MakeTaps(from.height, to.height)) {
  DS_CHECK(to.width > 0 && to.height > 0 && to.width <= from.width && to.height <= from.height,
           "{}x{} from {}x{}", to.width, to.height, from.width, from.height);
  for (std::vector<int32_t>& row : scaled_) row.resize(static_cast<size_t>(to.width));
  if (!CanShuffle()) return;
  for (size_t x = 0; x + 8 <= columns_.size(); x += 8) {
    Octet octet;
    octet.begin = columns_[x].first;
    if (octet.begin + 16 > from.width || columns_[x + 7].second - octet.begin > 15) break;
    for (size_t i = 0; i < 8; ++i) {
      const Tap& tap = columns_[x + i];
      octet.places[2 * i] = static_cast<uint8_t>(tap.first - octet.begin);
      octet.places[2 * i + 1] = static_cast<uint8_t>(tap.second - octet.begin);
      octet.weights[2 * i] = tap.weight_first;
      octet.weights[2 * i + 1] = tap.weight_second;
    }
    octets_.push_back(octet);
  }
}

#if defined(__x86_64__) && defined(__GNUC__)
__attribute__((target("ssse3")))
#endif
void Downscaler::ScaleRowOfOctets([[maybe_unused]] const uint8_t* in, [[maybe_unused]] const Octet* octets,
                                  [[maybe_unused]] size_t count, [[maybe_unused]] int32_t* out) {
#ifdef __x86_64__
  const __m128i zero = _mm_setzero_si128();
  for (size_t i = 0; i < count; ++i) {
    const Octet& octet = octets[i];
    const auto load = [](const void* at) { return _mm_loadu_si128(static_cast<const __m128i*>(at)); };
    const __m128i pairs = _mm_shuffle_epi8(load(in + octet.begin), load(octet.places.data()));
    const __m128i low = _mm_madd_epi16(_mm_unpacklo_epi8(pairs, zero), load(octet.weights.data()));
    const __m128i high = _mm_madd_epi16(_mm_unpackhi_epi8(pairs, zero), load(octet.weights.data() + 8));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out + 8 * i), low);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out + 8 * i + 4), high);
  }
#endif
}

void Downscaler::ScaleRow(const uint8_t* in, int32_t* out) const {
  ScaleRowOfOctets(in, octets_.data(), octets_.size(), out);
  for (size_t x = 8 * octets_.size(); x < columns_.size(); ++x) {
    const Tap& tap = columns_[x];
    out[x] = in[tap.first] * tap.weight_first + in[tap.second] * tap.weight_second;
  }
}

void Downscaler::Run(const cv::Mat& in, cv::Mat* out) {
  DS_CHECK(in.type() == CV_8UC1 && in.size() == from_ && out->type() == CV_8UC1 && out->size() == to_,
           "type={} {}x{} to type={} {}x{}", in.type(), in.cols, in.rows, out->type(), out->cols, out->rows);
  std::array<int, 2> held = {-1, -1};  // which rows `scaled_` has
  for (int y = 0; y < to_.height; ++y) {
    const Tap& tap = rows_[static_cast<size_t>(y)];
    if (held[1] == tap.first) {
      std::swap(scaled_[0], scaled_[1]);
      std::swap(held[0], held[1]);
    }
    const std::array<int, 2> wanted = {tap.first, tap.second};
    for (size_t i = 0; i < 2; ++i) {
      if (held[i] == wanted[i]) continue;
      ScaleRow(in.ptr<uint8_t>(wanted[i]), scaled_[i].data());
      held[i] = wanted[i];
    }
    MixRows(scaled_[0].data(), scaled_[1].data(), tap.weight_first, tap.weight_second, to_.width,
            out->ptr<uint8_t>(y));
  }
}

}  // namespace dynamic_slam
