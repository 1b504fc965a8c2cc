#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

// Makes one level of an image pyramid of the next finer one: bilinear, the bytes of cv::resize with
// INTER_LINEAR, without asking for memory each time.
class Downscaler {
 public:
  // Sizes in px; neither side gets longer.
  Downscaler(cv::Size from, cv::Size to);

  // in: CV_8UC1 of the size `from`. out: CV_8UC1 of the size `to`, with its memory.
  void Run(const cv::Mat& in, cv::Mat* out);

 private:
  // A coordinate of `to` lies between two neighbours of `from`; weights add up to kOne.
  struct Tap {
    int first = 0, second = 0;
    int16_t weight_first = 0, weight_second = 0;
  };
  // Eight columns of `to`, whose pixels lie within 16 of `from`.
  struct Octet {
    int begin = 0;                      // column of `from`
    std::array<uint8_t, 16> places{};   // from there: first, second, first, second, ...
    std::array<int16_t, 16> weights{};  // likewise
  };

  static std::vector<Tap> MakeTaps(int from, int to);
  static void ScaleRowOfOctets(const uint8_t* in, const Octet* octets, size_t count, int32_t* out);
  void ScaleRow(const uint8_t* in, int32_t* out) const;

  cv::Size from_, to_;
  std::vector<Tap> columns_, rows_;
  std::vector<Octet> octets_;                   // the first columns, as far as they can be read 16 at a time
  std::array<std::vector<int32_t>, 2> scaled_;  // rows of `from`, as wide as `to`, times kOne
};

}  // namespace dynamic_slam
