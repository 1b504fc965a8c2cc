#include "dynamic_slam/sim/color_materials.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <opencv2/imgproc.hpp>

// What all pictures are made with, and those of people; rooms and streets have files of their own.

namespace dynamic_slam {

cv::Scalar AnyColor(Random& random, double light_low, double light_high, double saturation) {
  const double hue = random.Uniform(0, 6), light = 255 * random.Uniform(light_low, light_high);
  const double strength = random.Uniform(0, saturation);
  const auto channel = [&](double shift) {
    const double distance = std::abs(std::remainder(hue - shift, 6.0));
    const double full = std::clamp(2.0 - distance, 0.0, 1.0);
    return light * (1 - strength * (1 - full));
  };
  return {channel(4), channel(2), channel(0)};
}

void AddOctaves(Random& random, double largest, double smallest, double amplitude, cv::Mat& image) {
  cv::Mat sum;
  image.convertTo(sum, CV_32F);
  for (double cell = largest; cell >= smallest; cell /= 2) {
    cv::Mat1f grid(static_cast<int>(image.rows / cell) + 3, static_cast<int>(image.cols / cell) + 3), smooth,
        grey[3];
    for (float* value = grid.ptr<float>(); value != grid.ptr<float>() + grid.total(); ++value) {
      *value = static_cast<float>(random.Uniform(-amplitude, amplitude));
    }
    cv::resize(grid, smooth, {}, cell, cell, cell > 1.5 ? cv::INTER_CUBIC : cv::INTER_NEAREST);
    cv::Mat1f part = smooth(cv::Rect(0, 0, image.cols, image.rows));
    cv::Mat colored;
    cv::merge(std::vector<cv::Mat>(static_cast<size_t>(image.channels()), part), colored);
    sum += colored;
  }
  sum.convertTo(image, CV_8U);
}

cv::Mat DrawPlain(uint64_t seed, int side, const cv::Scalar& color, double amplitude) {
  Random random(seed);
  cv::Mat image(side, side, CV_8UC3, color);
  AddOctaves(random, side / 4.0, 1, amplitude, image);
  return image;
}

cv::Mat DrawGrain() {
  // Octaves on grids that close upon themselves.
  constexpr int kSide = 512;
  Random random(77);
  cv::Mat1f sum(kSide, kSide, 128.0f);
  for (int cells = 16; cells <= kSide; cells *= 2) {
    cv::Mat1f grid(cells, cells), padded, smooth;
    for (float& value : grid) value = static_cast<float>(random.Uniform(-1, 1));
    cv::copyMakeBorder(grid, padded, 2, 2, 2, 2, cv::BORDER_WRAP);
    const int scale = kSide / cells;
    cv::resize(padded, smooth, {}, scale, scale, cv::INTER_CUBIC);
    sum += 9.0 * smooth(cv::Rect(2 * scale, 2 * scale, kSide, kSide));
  }
  for (int i = 0; i < 900; ++i) {  // specks
    const int y = static_cast<int>(random.Index(kSide)), x = static_cast<int>(random.Index(kSide));
    const double grey = random.Uniform(70, 185);
    cv::circle(sum, {x, y}, 1 + static_cast<int>(random.Index(4)), grey, cv::FILLED);
  }
  cv::Mat grey, image;
  sum.convertTo(grey, CV_8U);
  cv::cvtColor(grey, image, cv::COLOR_GRAY2BGR);
  return image;
}

cv::Mat DrawCloth(uint64_t seed, int side, const cv::Scalar& color, bool with_front, double richness) {
  Random random(seed);
  cv::Mat image(side, side, CV_8UC3, color);
  const cv::Scalar second = AnyColor(random, 0.1, 1.0, 0.9);
  const int step = std::max(side / (6 + static_cast<int>(random.Index(14))), 4);
  const uint32_t pattern = random.Index(7);
  switch (!with_front && (pattern == 2 || pattern == 3) ? 6 : pattern) {
    case 0:  // hoops
      for (int y = 0; y < side; y += step)
        cv::rectangle(image, {0, y}, {side, y + step / 2 - 1}, second, cv::FILLED);
      break;
    case 1: {  // checks
      cv::Mat over = image.clone();
      for (int y = 0; y < side; y += step)
        cv::rectangle(over, {0, y}, {side, y + step / 2 - 1}, second, cv::FILLED);
      cv::addWeighted(image, 0.5, over, 0.5, 0, image);
      over = image.clone();
      for (int x = 0; x < side; x += step)
        cv::rectangle(over, {x, 0}, {x + step / 2 - 1, side}, second, cv::FILLED);
      cv::addWeighted(image, 0.5, over, 0.5, 0, image);
      break;
    }
    case 2:  // a print on the chest, u = 0 is ahead: written across the seam
      for (const int x : {0, side}) {
        cv::ellipse(image, {x, side * 2 / 5}, {side / 9, side / 7}, 0, 0, 360, second, cv::FILLED,
                    cv::LINE_AA);
        cv::putText(image, "SLAM", {x - side / 12, side * 2 / 5 + side / 40}, cv::FONT_HERSHEY_DUPLEX,
                    side / 512.0 * 1.1, AnyColor(random, 0.1, 1.0), std::max(side / 200, 1), cv::LINE_AA);
      }
      break;
    case 3:  // an open jacket over a shirt
      for (const int x : {0, side}) {
        const cv::Point corners[] = {
            {x - side / 10, 0}, {x + side / 10, 0}, {x + side / 22, side}, {x - side / 22, side}};
        cv::fillConvexPoly(image, corners, 4, second, cv::LINE_AA);
        cv::line(image, corners[0], corners[3], cv::Scalar::all(20), side / 90 + 1, cv::LINE_AA);
        cv::line(image, corners[1], corners[2], cv::Scalar::all(20), side / 90 + 1, cv::LINE_AA);
      }
      break;
    case 4:  // dots
      for (int i = 0; i < side; ++i) {
        cv::circle(image, {static_cast<int>(random.Index(side)), static_cast<int>(random.Index(side))},
                   side / 120 + 1, second, cv::FILLED, cv::LINE_AA);
      }
      break;
    default:
      break;
  }
  // Folds: long dents, lit on one side.
  cv::Mat folded;
  image.convertTo(folded, CV_32F);
  cv::Mat1f relief(side, side, 0.0f);
  for (int i = 0; i < 60; ++i) {
    const double y = random.Uniform(0, side), x = random.Uniform(0, side);
    const cv::Point2d at(x, y);
    const double angle = random.Uniform(-0.7, 0.7), length = side * random.Uniform(0.03, 0.16);
    const cv::Point2d half(length * std::cos(angle), length * std::sin(angle));
    const int breadth = 1 + static_cast<int>(random.Index(side / 40 + 1));
    cv::line(relief, cv::Point(at - half), cv::Point(at + half), random.Uniform(-45, 35), breadth,
             cv::LINE_AA);
  }
  cv::GaussianBlur(relief, relief, {}, side / 170.0);
  cv::Mat colored;
  cv::merge(std::vector<cv::Mat>(3, relief), colored);
  folded += richness * colored;
  folded.convertTo(image, CV_8U);
  AddOctaves(random, side / 8.0, 1, 6 * richness, image);
  return image;
}

cv::Mat DrawFace(uint64_t seed, int side, const cv::Scalar& skin, const cv::Scalar& hair) {
  // u: around the head from the front over the left side; v: from the chin (0) to the crown (1).
  Random random(seed);
  cv::Mat image(side, side, CV_8UC3, skin);
  const auto x_of = [side](double turns) { return cvRound((turns + 1) * side) % side; };
  const auto y_of = [side](double share) { return cvRound(share * side); };
  const double unit = side / 256.0;
  // Hair: above the forehead, lower at the sides, down to the neck behind.
  std::vector<cv::Point> outline = {{0, side}};
  for (int x = 0; x <= side; x += side / 64) {
    const double from_front =
        std::abs(std::remainder(static_cast<double>(x) / side, 1.0)) * 2;  // 0 front, 1 back
    const double line = from_front < 0.33 ? 0.74 : from_front < 0.5 ? 0.52 : 0.12;
    outline.emplace_back(x, y_of(line + random.Uniform(-0.02, 0.02)));
  }
  outline.emplace_back(side, side);
  cv::fillPoly(image, std::vector<std::vector<cv::Point>>{outline}, hair, cv::LINE_AA);
  const auto both = [&](double turns, auto draw) {
    draw(x_of(turns));
    draw(x_of(-turns));
  };
  const cv::Scalar dark = skin * 0.55, lips(skin[0] * 0.75, skin[1] * 0.6, skin[2] * 0.95);
  both(0.052, [&](int x) {
    cv::ellipse(image, {x, y_of(0.535)}, {cvRound(9 * unit), cvRound(5 * unit)}, 0, 0, 360, {235, 235, 235},
                cv::FILLED, cv::LINE_AA);
    cv::circle(image, {x, y_of(0.535)}, cvRound(4.5 * unit), {30, 25, 25}, cv::FILLED, cv::LINE_AA);
    cv::ellipse(image, {x, y_of(0.60)}, {cvRound(12 * unit), cvRound(3 * unit)}, 0, 0, 360, hair * 0.8,
                cv::FILLED, cv::LINE_AA);
  });
  both(0.25, [&](int x) {  // ears
    cv::ellipse(image, {x, y_of(0.47)}, {cvRound(7 * unit), cvRound(18 * unit)}, 0, 0, 360, skin * 0.8,
                cv::FILLED, cv::LINE_AA);
  });
  const bool bearded = random.Index(5) == 0;
  for (const int x : {0, side}) {  // on the seam
    cv::line(image, {x, y_of(0.52)}, {x, y_of(0.37)}, dark * 1.35, cvRound(8 * unit), cv::LINE_AA);
    cv::ellipse(image, {x, y_of(0.355)}, {cvRound(11 * unit), cvRound(4 * unit)}, 0, 0, 360, dark, cv::FILLED,
                cv::LINE_AA);
    cv::ellipse(image, {x, y_of(0.22)}, {cvRound(17 * unit), cvRound(5 * unit)}, 0, 0, 360, lips, cv::FILLED,
                cv::LINE_AA);
    if (bearded) {
      cv::ellipse(image, {x, y_of(0.1)}, {cvRound(34 * unit), cvRound(18 * unit)}, 0, 0, 360, hair,
                  cv::FILLED, cv::LINE_AA);
    }
  }
  cv::GaussianBlur(image, image, {}, 1.2 * unit);
  AddOctaves(random, side / 16.0, 1, 4, image);
  return image;
}

}  // namespace dynamic_slam
