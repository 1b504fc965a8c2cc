#include <algorithm>
#include <cmath>
#include <string>

#include <opencv2/imgproc.hpp>

#include "dynamic_slam/sim/color_materials.h"

namespace dynamic_slam {
namespace {

// Lines of writing in a rectangle, as tall as `letter` texels.
void Write(Random& random, const cv::Rect& area, double letter, const cv::Scalar& ink, cv::Mat& image) {
  const cv::Rect inside = area & cv::Rect(0, 0, image.cols, image.rows);
  if (inside.width < 4 || inside.height < 4) return;
  cv::Mat sheet = image(inside);
  for (double y = 1.2 * letter; y < sheet.rows; y += 1.5 * letter) {
    std::string text;
    const int letters =
        3 + static_cast<int>(random.Index(static_cast<uint32_t>(sheet.cols / (0.8 * letter) + 2)));
    for (int i = 0; i < letters; ++i) {
      if (random.Index(6) == 0) {
        text += ' ';
        continue;
      }
      const char capital = static_cast<char>('A' + random.Index(26));
      text += random.Index(4) == 0 ? capital : static_cast<char>(capital + 32);
    }
    cv::putText(sheet, text, {0, cvRound(y)}, cv::FONT_HERSHEY_SIMPLEX, letter / 22.0, ink,
                std::max(1, cvRound(letter / 8)), cv::LINE_AA);
  }
}

cv::Point AnyPoint(Random& random, const cv::Mat& image) {
  return {static_cast<int>(random.Index(static_cast<uint32_t>(image.cols))),
          static_cast<int>(random.Index(static_cast<uint32_t>(image.rows)))};
}

// A picture of nothing in particular: a ground and shapes upon it.
void Picture(Random& random, const cv::Rect& area, cv::Mat& image) {
  const cv::Rect inside = area & cv::Rect(0, 0, image.cols, image.rows);
  if (inside.width < 4 || inside.height < 4) return;
  cv::Mat sheet = image(inside);
  sheet.setTo(AnyColor(random, 0.2, 0.9));
  const int shapes = 4 + static_cast<int>(random.Index(8));
  for (int i = 0; i < shapes; ++i) {
    const cv::Point at = AnyPoint(random, sheet);
    const int size = std::max(2, cvRound(std::min(sheet.cols, sheet.rows) * random.Uniform(0.05, 0.4)));
    if (random.Index(2) == 0) {
      const cv::Scalar color = AnyColor(random, 0.1, 1, 0.8);
      cv::ellipse(sheet, at, {size, std::max(1, size / 2)}, random.Uniform(0, 180), 0, 360, color, cv::FILLED,
                  cv::LINE_AA);
    } else {
      cv::rectangle(sheet, at, at + cv::Point(size, size), AnyColor(random, 0.1, 1, 0.8), cv::FILLED);
    }
  }
}

}  // namespace

cv::Mat DrawWall(uint64_t seed, int width, int height, const cv::Scalar& color, double richness) {
  Random random(seed);
  cv::Mat image(height, width, CV_8UC3, color);
  AddOctaves(random, height / 2.0, 6, 5 * richness, image);
  // What a wall in use collects: marks, scuffs, filled holes, sockets, cables.
  const int marks = cvRound(richness * width * height / 1500.0);
  for (int i = 0; i < marks; ++i) {
    const cv::Point at = AnyPoint(random, image);
    const double size = 1.0 * std::pow(12.0, random.Uniform());
    const cv::Scalar ink = color * random.Uniform(0.55, 1.15);
    if (random.Index(2) == 0) {
      const double angle_deg = random.Uniform(0, 180);
      cv::ellipse(image, at, {cvCeil(size), cvCeil(size * random.Uniform(0.3, 1))}, angle_deg, 0, 360, ink,
                  cv::FILLED, cv::LINE_AA);
    } else {
      const int down = cvRound(random.Uniform(-3, 3) * size), right = cvRound(random.Uniform(-3, 3) * size);
      cv::line(image, at, at + cv::Point(right, down), ink, std::max(1, cvRound(size / 4)), cv::LINE_AA);
    }
  }
  cv::rectangle(image, {0, height - height / 28}, {width, height}, AnyColor(random, 0.25, 0.5, 0.3),
                cv::FILLED);
  AddOctaves(random, 4, 1, 5 * richness, image);
  return image;
}

cv::Mat DrawPoster(uint64_t seed, int width, int height) {
  Random random(seed);
  const bool dark = random.Index(3) == 0;
  cv::Mat image(height, width, CV_8UC3,
                dark ? AnyColor(random, 0.1, 0.35, 0.7) : AnyColor(random, 0.75, 1.0, 0.35));
  const cv::Scalar ink = dark ? cv::Scalar(235, 240, 240) : AnyColor(random, 0.05, 0.35, 0.8);
  const int margin = width / 14;
  Write(random, {margin, height / 40, width - 2 * margin, height / 8}, height / 11.0, ink, image);
  const int pictures = 1 + static_cast<int>(random.Index(3));
  int top = height / 6;
  for (int i = 0; i < pictures; ++i) {
    const int bottom = top + (height - top - margin) / (pictures - i);
    const bool left = random.Index(2) == 0;
    const cv::Rect a(margin, top, (width - 3 * margin) / 2, bottom - top - margin / 2);
    const cv::Rect b(a.x + a.width + margin, top, a.width, a.height);
    Picture(random, left ? a : b, image);
    Write(random, left ? b : a, height * random.Uniform(0.014, 0.03), ink, image);
    top = bottom;
  }
  cv::rectangle(image, {0, 0}, {width - 1, height - 1}, ink, std::max(1, width / 90));
  AddOctaves(random, 4, 1, 3, image);
  return image;
}

cv::Mat DrawScreen(uint64_t seed, int width, int height) {
  Random random(seed);
  cv::Mat image(height, width, CV_8UC3, AnyColor(random, 0.2, 0.6, 0.8));
  AddOctaves(random, height / 2.0, 8, 12, image);
  const int windows = 2 + static_cast<int>(random.Index(3));
  for (int i = 0; i < windows; ++i) {
    const int w = cvRound(width * random.Uniform(0.35, 0.7)),
              h = cvRound(height * random.Uniform(0.35, 0.75));
    const int y = static_cast<int>(random.Index(height - h)), x = static_cast<int>(random.Index(width - w));
    const cv::Rect window(x, y, w, h);
    const bool dark = random.Index(2) == 0;
    cv::rectangle(image, window, dark ? cv::Scalar(40, 35, 30) : cv::Scalar(245, 245, 245), cv::FILLED);
    cv::rectangle(image, {window.x, window.y, w, height / 28}, AnyColor(random, 0.3, 0.8), cv::FILLED);
    const cv::Rect content(window.x + 4, window.y + height / 24, w - 8, h - height / 22);
    if (random.Index(3) == 0) {
      Picture(random, content, image);
    } else {
      Write(random, content, height / 34.0, dark ? cv::Scalar(160, 220, 170) : cv::Scalar(60, 40, 40), image);
    }
  }
  cv::rectangle(image, {0, 0}, {width - 1, height - 1}, {25, 25, 25}, std::max(2, width / 28));
  return image;
}

cv::Mat DrawCarpet(uint64_t seed, int side) {
  Random random(seed);
  cv::Mat image(side, side, CV_8UC3, AnyColor(random, 0.3, 0.5, 0.4));
  AddOctaves(random, side / 4.0, 1, 7, image);
  for (int i = 0; i < side * side / 260; ++i) {
    const cv::Scalar color = AnyColor(random, 0.15, 0.75, 0.5);
    const int radius = static_cast<int>(random.Index(3));
    cv::circle(image, AnyPoint(random, image), radius, color, cv::FILLED, cv::LINE_AA);
  }
  return image;
}

cv::Mat DrawTiles(uint64_t seed, int side, int tiles) {
  Random random(seed);
  cv::Mat image(side, side, CV_8UC3);
  const cv::Scalar base = AnyColor(random, 0.5, 0.7, 0.2);
  const int step = side / tiles;
  for (int y = 0; y < tiles; ++y) {
    for (int x = 0; x < tiles; ++x) {
      cv::rectangle(image, {x * step, y * step, step, step}, base * random.Uniform(0.86, 1.1), cv::FILLED);
    }
  }
  AddOctaves(random, side / 8.0, 2, 5, image);
  for (int i = 0; i < side * side / 700; ++i) {
    const cv::Scalar color = AnyColor(random, 0.25, 0.9, 0.2);
    const int radius = static_cast<int>(random.Index(4));
    cv::circle(image, AnyPoint(random, image), radius, color, cv::FILLED, cv::LINE_AA);
  }
  for (int i = 0; i <= tiles; ++i) {
    cv::line(image, {i * step, 0}, {i * step, side}, base * 0.55, std::max(1, side / 300));
    cv::line(image, {0, i * step}, {side, i * step}, base * 0.55, std::max(1, side / 300));
  }
  return image;
}

cv::Mat DrawWood(uint64_t seed, int width, int height) {
  Random random(seed);
  cv::Mat image(height, width, CV_8UC3);
  const double light = random.Uniform(0.5, 1.0);
  cv::Mat1f grid(height, 12);
  for (float& value : grid) value = static_cast<float>(random.Uniform());
  cv::Mat1f fibre;
  cv::resize(grid, fibre, image.size(), 0, 0, cv::INTER_CUBIC);
  cv::GaussianBlur(fibre, fibre, {0, 0}, width / 60.0, 0.7);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double value = light * (0.85 + 0.25 * fibre(y, x));
      image.at<cv::Vec3b>(y, x) = {cv::saturate_cast<uint8_t>(95 * value),
                                   cv::saturate_cast<uint8_t>(145 * value),
                                   cv::saturate_cast<uint8_t>(190 * value)};
    }
  }
  AddOctaves(random, height / 4.0, 1, 2.5, image);
  return image;
}

cv::Mat DrawCeiling(uint64_t seed, int side, int panels) {
  Random random(seed);
  cv::Mat image(side, side, CV_8UC3, cv::Scalar(215, 220, 220));
  const int step = side / panels;
  for (int i = 0; i < side * side / 400; ++i) {
    const cv::Scalar grey = cv::Scalar::all(random.Uniform(165, 205));
    const int radius = static_cast<int>(random.Index(2));
    cv::circle(image, AnyPoint(random, image), radius, grey, cv::FILLED);
  }
  for (int y = 0; y < panels; ++y) {
    for (int x = 0; x < panels; ++x) {
      const cv::Rect panel(x * step, y * step, step, step);
      if (x % 3 == 1 && y % 2 == 1) cv::rectangle(image, panel, {255, 255, 255}, cv::FILLED);
      cv::rectangle(image, panel, {150, 155, 155}, std::max(1, side / 400));
    }
  }
  return image;
}

cv::Mat DrawDoor(uint64_t seed, int width, int height) {
  Random random(seed);
  cv::Mat image = DrawWood(seed, width, height);
  if (random.Index(2) == 0) {
    image.setTo(AnyColor(random, 0.35, 0.8, 0.6));
    AddOctaves(random, width / 2.0, 1, 4, image);
  }
  cv::rectangle(image, {0, 0}, {width - 1, height}, {60, 60, 65}, width / 16);
  cv::rectangle(image, {cvRound(0.82 * width), height / 2, width / 9, height / 60}, {190, 190, 195},
                cv::FILLED);
  Write(random, {width / 4, height / 4, width / 2, height / 10}, height / 36.0, {30, 30, 30}, image);
  if (random.Index(2) == 0) {
    cv::rectangle(image, {cvRound(0.6 * width), height / 6, width / 5, height / 3}, {140, 120, 100},
                  cv::FILLED);
  }
  return image;
}

cv::Mat DrawClutter(uint64_t seed, int width, int height) {
  Random random(seed);
  cv::Mat image = DrawWood(seed, width, height);
  for (int i = 0; i < 26; ++i) {
    const double w = height * random.Uniform(0.12, 0.45), h = w * random.Uniform(0.6, 1.4);
    const cv::Point at = AnyPoint(random, image);
    const cv::Rect sheet = cv::Rect(at.x, at.y, cvRound(w), cvRound(h)) & cv::Rect(0, 0, width, height);
    if (sheet.width < 8 || sheet.height < 8) continue;
    if (random.Index(3) == 0) {
      Picture(random, sheet, image);
    } else {
      cv::rectangle(image, sheet, AnyColor(random, 0.7, 1.0, 0.2), cv::FILLED);
      Write(random, {sheet.x + 3, sheet.y + 2, sheet.width - 6, sheet.height - 4}, random.Uniform(5, 12),
            {50, 45, 45}, image);
    }
  }
  return image;
}

cv::Mat DrawBooks(uint64_t seed, int width, int height) {
  Random random(seed);
  cv::Mat image(height, width, CV_8UC3, cv::Scalar(45, 60, 75));
  constexpr int kBoards = 5;
  const int board = height / kBoards;
  for (int row = 0; row < kBoards; ++row) {
    const int bottom = (row + 1) * board - board / 12;
    for (int x = width / 40; x < width - width / 40;) {
      const int w = cvRound(board * random.Uniform(0.08, 0.3)),
                h = cvRound(board * random.Uniform(0.55, 0.88));
      if (random.Index(9) != 0) {
        const cv::Rect book(x, bottom - h, std::min(w, width - width / 40 - x), h);
        cv::rectangle(image, book, AnyColor(random, 0.2, 0.95, 0.8), cv::FILLED);
        cv::rectangle(image, {book.x + 1, book.y + h / 6, std::max(1, book.width - 2), h / 7},
                      AnyColor(random, 0.2, 1), cv::FILLED);
        cv::rectangle(image, book, {30, 30, 30}, 1);
      }
      x += w;
    }
    cv::rectangle(image, {0, bottom, width, board / 12}, {95, 135, 170}, cv::FILLED);
  }
  AddOctaves(random, 8, 1, 5, image);
  return image;
}

}  // namespace dynamic_slam
