#include "dynamic_slam/sim/texture.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

// Size between low and high with the same chance for each octave.
double LogUniform(Random& random, double low, double high) {
  return low * std::pow(high / low, random.Uniform());
}

// Adds smooth noise whose features are `cell` texels large.
void AddNoise(Random& random, double cell, double amplitude, cv::Mat1f& image) {
  const int columns = static_cast<int>(std::ceil(image.cols / cell)) + 2;
  const int rows = static_cast<int>(std::ceil(image.rows / cell)) + 2;
  cv::Mat1f grid(rows, columns), smooth;
  for (float& value : grid) value = static_cast<float>(random.Uniform(-amplitude, amplitude));
  cv::resize(grid, smooth, image.size(), 0, 0, cv::INTER_CUBIC);
  image += smooth;
}

cv::Scalar Ink(Random& random) { return cv::Scalar(random.Uniform(15, 240)); }

cv::Point2d AnyPlace(Random& random, const cv::Mat& image) {
  const double y = random.Uniform(0, image.rows), x = random.Uniform(0, image.cols);
  return {x, y};
}

std::vector<cv::Point> Corners(const cv::Point2d& centre, double width, double height, double angle_rad) {
  std::vector<cv::Point> corners;
  for (const auto& [sx, sy] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) {
    const double x = sx * width, y = sy * height;
    corners.emplace_back(cvRound(centre.x + std::cos(angle_rad) * x - std::sin(angle_rad) * y),
                         cvRound(centre.y + std::sin(angle_rad) * x + std::cos(angle_rad) * y));
  }
  return corners;
}

void DrawPatch(Random& random, double size, cv::Mat1b& image) {
  const cv::Point2d centre = AnyPlace(random, image);
  const double angle_rad = random.Uniform(0, std::numbers::pi);
  switch (random.Index(4)) {
    case 0: {
      const cv::Scalar ink = Ink(random);
      cv::fillConvexPoly(image, Corners(centre, size, size * random.Uniform(0.2, 1.0), angle_rad), ink,
                         cv::LINE_AA);
      break;
    }
    case 1: {  // any polygon
      std::vector<std::vector<cv::Point>> outline(1);
      const int corners = 3 + static_cast<int>(random.Index(5));
      for (int i = 0; i < corners; ++i) {
        const double turn = 2.0 * std::numbers::pi * i / corners, radius = size * random.Uniform(0.2, 0.6);
        outline[0].emplace_back(cvRound(centre.x + radius * std::cos(turn)),
                                cvRound(centre.y + radius * std::sin(turn)));
      }
      cv::fillPoly(image, outline, Ink(random), cv::LINE_AA);
      break;
    }
    case 2: {
      const cv::Scalar ink = Ink(random);
      cv::ellipse(image, cv::Point(centre),
                  cv::Size(cvCeil(size / 2), cvCeil(size * random.Uniform(0.1, 0.5))),
                  angle_rad * 180 / std::numbers::pi, 0, 360, ink, cv::FILLED, cv::LINE_AA);
      break;
    }
    default: {  // a stroke
      const cv::Point2d half(0.8 * size * std::cos(angle_rad), 0.8 * size * std::sin(angle_rad));
      const int breadth = std::max(1, cvRound(size * random.Uniform(0.04, 0.15)));
      cv::line(image, cv::Point(centre - half), cv::Point(centre + half), Ink(random), breadth, cv::LINE_AA);
    }
  }
}

void DrawPoster(Random& random, double size, cv::Mat1b& image) {
  const cv::Point2d centre = AnyPlace(random, image);
  const double width = size, height = size * random.Uniform(0.6, 1.4);
  const bool dark = random.Index(3) == 0;
  const cv::Scalar paper(dark ? random.Uniform(20, 70) : random.Uniform(180, 245));
  const cv::Rect frame(cvRound(centre.x - width / 2), cvRound(centre.y - height / 2), cvRound(width),
                       cvRound(height));
  cv::rectangle(image, frame, paper, cv::FILLED);
  cv::rectangle(image, frame, cv::Scalar(dark ? 220 : 30), std::max(1, cvRound(size * 0.012)));
  const cv::Rect inside = frame & cv::Rect(0, 0, image.cols, image.rows);
  if (inside.width < 16 || inside.height < 16) return;
  cv::Mat1b sheet = image(inside);
  for (int i = 0; i < 5; ++i) DrawPatch(random, size * random.Uniform(0.05, 0.3), sheet);
  for (double y = 0.1; y < 0.95;) {
    const double letter = LogUniform(random, 0.03, 0.12) * size;  // height of a line, texels
    std::string text;
    const int letters = 3 + static_cast<int>(random.Index(20));
    for (int i = 0; i < letters; ++i) text += static_cast<char>('!' + random.Index(90));
    y += 1.4 * letter / height;
    cv::putText(sheet, text, cv::Point(cvRound(0.06 * width), cvRound(y * height)), cv::FONT_HERSHEY_SIMPLEX,
                letter / 24.0, cv::Scalar(dark ? random.Uniform(150, 250) : random.Uniform(10, 110)),
                std::max(1, cvRound(letter / 9)), cv::LINE_AA);
  }
}

}  // namespace

Texture::Texture(const cv::Mat& image) {
  DS_CHECK(image.type() == CV_8UC1 && !image.empty());
  levels_.push_back(image);
  while (levels_.back().cols % 2 == 0 && levels_.back().rows % 2 == 0) {
    cv::Mat half;
    cv::resize(levels_.back(), half, levels_.back().size() / 2, 0, 0, cv::INTER_AREA);
    levels_.push_back(half);
  }
}

float Texture::Sample(float x, float y, float level) const {
  const float coarsest = static_cast<float>(levels_.size() - 1);
  level = std::clamp(level, 0.0f, coarsest);
  const int fine = static_cast<int>(level);
  const float share = level - static_cast<float>(fine);
  const float value = SampleLevel(x, y, fine);
  return share < 0.01f ? value : value + share * (SampleLevel(x, y, fine + 1) - value);
}

float Texture::SampleLevel(float x, float y, int level) const {
  const cv::Mat& image = levels_[level];
  const float shrink = 1.0f / static_cast<float>(1 << level);
  x = std::clamp(x * shrink - 0.5f, 0.0f, static_cast<float>(image.cols - 1));
  y = std::clamp(y * shrink - 0.5f, 0.0f, static_cast<float>(image.rows - 1));
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, image.cols - 1), y1 = std::min(y0 + 1, image.rows - 1);
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const uint8_t *upper = image.ptr<uint8_t>(y0), *lower = image.ptr<uint8_t>(y1);
  const float top = upper[x0] + fx * (upper[x1] - upper[x0]);
  const float bottom = lower[x0] + fx * (lower[x1] - lower[x0]);
  return top + fy * (bottom - top);
}

cv::Mat MakeRichTexture(uint64_t seed, double width_m, double height_m, double texels_per_m) {
  Random random(seed);
  const auto side = [texels_per_m](double metres) {
    return 64 * std::max(1, static_cast<int>(std::ceil(metres * texels_per_m / 64 - 1e-9)));
  };
  cv::Mat1f base(side(height_m), side(width_m), static_cast<float>(random.Uniform(90, 170)));
  for (double cell_m = 1.6; cell_m > 0.03; cell_m /= 2) AddNoise(random, cell_m * texels_per_m, 16, base);
  cv::Mat1b image;
  base.convertTo(image, CV_8U);

  const double area_m2 = width_m * height_m;
  const int patches = static_cast<int>(40 * area_m2) + 10, posters = static_cast<int>(0.5 * area_m2) + 1;
  const double largest_m = 0.5 * std::min(1.2, std::min(width_m, height_m));
  std::vector<double> sizes_m;
  for (int i = 0; i < patches; ++i) sizes_m.push_back(LogUniform(random, 0.02, largest_m));
  std::sort(sizes_m.rbegin(), sizes_m.rend());  // large ones first: they must not cover the small ones
  for (const double size_m : sizes_m) DrawPatch(random, size_m * texels_per_m, image);
  for (int i = 0; i < posters; ++i)
    DrawPoster(random, random.Uniform(0.5, 1.0) * largest_m * texels_per_m, image);

  image.convertTo(base, CV_32F);
  for (const double cell_m : {0.024, 0.012, 0.006}) AddNoise(random, cell_m * texels_per_m, 10, base);
  base.convertTo(image, CV_8U, 0.9, 10);
  return image;
}

}  // namespace dynamic_slam
