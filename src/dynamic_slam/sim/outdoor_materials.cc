#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <opencv2/imgproc.hpp>

#include "dynamic_slam/sim/color_materials.h"

namespace dynamic_slam {
namespace {

cv::Point AnyPoint(Random& random, const cv::Mat& image) {
  return {static_cast<int>(random.Index(static_cast<uint32_t>(image.cols))),
          static_cast<int>(random.Index(static_cast<uint32_t>(image.rows)))};
}

// Sizes of a facade in texels.
struct Facade {
  double per_m_x, per_m_y;
  int width, height;
  int X(double m) const { return cvRound(m * per_m_x); }
  int Y(double up_m) const { return height - cvRound(up_m * per_m_y); }
  cv::Rect Area(double x_m, double up_m, double w_m, double h_m) const {
    return cv::Rect(cv::Point(X(x_m), Y(up_m + h_m)), cv::Point(X(x_m + w_m), Y(up_m)));
  }
};

void DrawBricks(Random& random, const Facade& f, const cv::Scalar& color, cv::Mat& image) {
  const double course = 0.28, brick = 0.8;  // m; larger than true ones, so that they are seen
  int row = 0;
  for (double up = 0; f.Y(up) > 0; up += course, ++row) {
    for (double x = row % 2 * -brick / 2; f.X(x) < f.width; x += brick) {
      cv::rectangle(image, f.Area(x, up, brick, course), color * random.Uniform(0.8, 1.12), cv::FILLED);
    }
    cv::line(image, {0, f.Y(up)}, {f.width, f.Y(up)}, color * 0.7, 1);
  }
}

void DrawWindow(Random& random, const Facade& f, const cv::Rect& at, const cv::Scalar& frame,
                cv::Mat& image) {
  const double dark = random.Uniform(0.15, 0.5);
  cv::rectangle(image, at, cv::Scalar(125, 110, 95) * dark, cv::FILLED);
  // Curtains, blinds, lamps, plants: no two windows are alike.
  switch (random.Index(5)) {
    case 0:
      cv::rectangle(image, {at.x, at.y, at.width / 4, at.height}, AnyColor(random, 0.5, 0.95, 0.4),
                    cv::FILLED);
      cv::rectangle(image, {at.x + 3 * at.width / 4, at.y, at.width / 4 + 1, at.height},
                    AnyColor(random, 0.5, 0.95, 0.4), cv::FILLED);
      break;
    case 1: {
      const cv::Scalar blind = AnyColor(random, 0.5, 0.9, 0.3);
      cv::rectangle(image, {at.x, at.y, at.width, cvRound(at.height * random.Uniform(0.2, 0.9))}, blind,
                    cv::FILLED);
      break;
    }
    case 2:
      cv::circle(image, {at.x + at.width / 2, at.y + at.height * 3 / 4}, std::max(2, at.width / 5),
                 cv::Scalar(60, 120, 60), cv::FILLED, cv::LINE_AA);
      break;
    default: {
      const cv::Scalar color = cv::Scalar(150, 138, 125) * random.Uniform(0.5, 1.0);
      cv::line(image, {at.x, at.y + at.height},
               {at.x + at.width, at.y + cvRound(at.height * random.Uniform(0, 0.6))}, color,
               std::max(1, at.width / 8), cv::LINE_AA);
    }
  }
  const int thick = std::max(1, cvRound(0.07 * f.per_m_x));
  cv::rectangle(image, at, frame, thick);
  cv::line(image, {at.x + at.width / 2, at.y}, {at.x + at.width / 2, at.y + at.height}, frame,
           std::max(1, thick - 1));
  if (random.Index(2) == 0)
    cv::line(image, {at.x, at.y + at.height / 3}, {at.x + at.width, at.y + at.height / 3}, frame, 1);
  cv::rectangle(image, {at.x - thick, at.y + at.height, at.width + 2 * thick, thick + 1}, frame * 0.75,
                cv::FILLED);
}

// A name over a shop.
void DrawSign(Random& random, const cv::Rect& at, cv::Mat& image) {
  const cv::Scalar ground = AnyColor(random, 0.15, 0.95, 0.9);
  cv::rectangle(image, at, ground, cv::FILLED);
  std::string text;
  const int letters = 4 + static_cast<int>(random.Index(7));
  for (int i = 0; i < letters; ++i) text += static_cast<char>('A' + random.Index(26));
  const bool dark = ground[0] + ground[1] + ground[2] > 330;
  cv::putText(image, text, {at.x + at.width / 12, at.y + at.height * 4 / 5}, cv::FONT_HERSHEY_DUPLEX,
              at.height / 32.0, dark ? cv::Scalar(25, 20, 20) : cv::Scalar(240, 245, 245),
              std::max(1, at.height / 10), cv::LINE_AA);
}

void DrawGroundFloor(Random& random, const Facade& f, double width_m, const cv::Scalar& frame,
                     cv::Mat& image) {
  for (double x = 0.4; x + 1.4 < width_m;) {
    const double w = std::min(random.Uniform(2.6, 4.5), width_m - x - 0.3);
    const uint32_t kind = random.Index(3);
    if (kind == 0 || w < 2) {  // a door between two windows
      cv::rectangle(image, f.Area(x + w / 2 - 0.6, 0.1, 1.2, 2.4), AnyColor(random, 0.15, 0.7, 0.8),
                    cv::FILLED);
      cv::rectangle(image, f.Area(x + w / 2 - 0.6, 0.1, 1.2, 2.4), frame, 2);
      cv::rectangle(image, f.Area(x + w / 2 - 0.35, 1.5, 0.7, 0.8), {60, 50, 45}, cv::FILLED);
    } else {  // a shop
      const cv::Rect pane = f.Area(x, 0.5, w, 2.2);
      cv::rectangle(image, pane, {58, 50, 42}, cv::FILLED);
      for (int i = 0; i < 14; ++i) {
        const double high = random.Uniform(0.1, 0.7), wide = random.Uniform(0.1, 0.6),
                     up = random.Uniform(0, 1.4), along = random.Uniform(0.05, 0.8) * w;
        const cv::Rect thing = f.Area(x + along, 0.55 + up, wide, high);
        cv::rectangle(image, thing & pane, AnyColor(random, 0.2, 0.95, 0.7), cv::FILLED);
      }
      cv::rectangle(image, pane, frame, 2);
      DrawSign(random, f.Area(x, 2.8, w, 0.62), image);
      if (kind == 2) {  // an awning
        const cv::Scalar a = AnyColor(random, 0.4, 0.9, 0.9), b(235, 235, 235);
        for (int i = 0; i < 12; ++i)
          cv::rectangle(image, f.Area(x + w * i / 12, 2.35, w / 12, 0.42), i % 2 == 0 ? a : b, cv::FILLED);
      }
    }
    x += w + random.Uniform(0.3, 0.7);
  }
}

}  // namespace

cv::Mat DrawFacade(uint64_t seed, int width, int height, double width_m, double height_m) {
  Random random(seed);
  const Facade f{width / width_m, height / height_m, width, height};
  const cv::Scalar warm[] = {{150, 190, 215}, {170, 205, 225}, {120, 150, 190}, {95, 115, 165},
                             {190, 205, 210}, {160, 175, 175}, {110, 130, 140}, {140, 170, 160}};
  const double light = random.Uniform(0.75, 1.1);
  const cv::Scalar color = warm[random.Index(std::size(warm))] * light;
  cv::Mat image(height, width, CV_8UC3, color);
  if (random.Index(2) == 0) DrawBricks(random, f, color, image);
  AddOctaves(random, height / 3.0, 4, 6, image);
  const cv::Scalar frame = random.Index(2) == 0 ? cv::Scalar(235, 238, 238) : color * 0.5;
  const double storey = random.Uniform(2.9, 3.5), ground = 3.6;
  const double window_w = random.Uniform(0.9, 1.5), window_h = random.Uniform(1.4, 2.0);
  const int columns = std::max(2, static_cast<int>(width_m / (window_w + random.Uniform(0.9, 1.5))));
  const double step = width_m / columns;
  const bool balconies = random.Index(3) == 0;
  for (double up = ground; up + storey < height_m; up += storey) {
    cv::rectangle(image, f.Area(0, up - 0.12, width_m, 0.16), color * 1.15, cv::FILLED);
    cv::line(image, {0, f.Y(up - 0.13)}, {width, f.Y(up - 0.13)}, color * 0.6, 1);
    for (int i = 0; i < columns; ++i) {
      const double x = (i + 0.5) * step - window_w / 2;
      DrawWindow(random, f, f.Area(x, up + 0.7, window_w, window_h), frame, image);
      if (balconies && i % 2 == 1) {
        const cv::Rect rail = f.Area(x - 0.2, up + 0.1, window_w + 0.4, 0.9);
        for (int k = 0; k <= 12; ++k) {
          cv::line(image, {rail.x + rail.width * k / 12, rail.y},
                   {rail.x + rail.width * k / 12, rail.y + rail.height}, {50, 50, 50}, 1);
        }
        cv::rectangle(image, rail, {45, 45, 45}, 2);
      }
    }
  }
  cv::rectangle(image, f.Area(0, 0, width_m, ground - 0.2), color * random.Uniform(0.6, 0.95), cv::FILLED);
  DrawGroundFloor(random, f, width_m, frame, image);
  cv::rectangle(image, f.Area(0, height_m - 0.45, width_m, 0.45), color * 0.75, cv::FILLED);
  for (const double x : {0.12, width_m - 0.24}) {  // pipes
    cv::rectangle(image, f.Area(x, 0, 0.12, height_m), cv::Scalar::all(random.Uniform(60, 130)), cv::FILLED);
  }
  for (int i = 0; i < cvRound(width_m * height_m / 2); ++i) {  // stains, repairs, what people spray
    const cv::Point at = AnyPoint(random, image);
    const double size = 1.5 * std::pow(8.0, random.Uniform());
    const cv::Scalar ink = color * random.Uniform(0.55, 1.2);
    const double angle_deg = random.Uniform(0, 180);
    cv::ellipse(image, at, {cvCeil(size), cvCeil(size * random.Uniform(0.3, 1))}, angle_deg, 0, 360, ink,
                cv::FILLED, cv::LINE_AA);
  }
  AddOctaves(random, 4, 1, 5, image);
  return image;
}

cv::Mat DrawAsphalt(uint64_t seed, int side) {
  Random random(seed);
  cv::Mat image(side, side, CV_8UC3, cv::Scalar(92, 92, 94));
  AddOctaves(random, side / 4.0, 1, 6, image);
  for (int i = 0; i < side * side / 220; ++i) {
    const cv::Scalar grey = cv::Scalar::all(random.Uniform(50, 150));
    const int radius = static_cast<int>(random.Index(3));
    cv::circle(image, AnyPoint(random, image), radius, grey, cv::FILLED, cv::LINE_AA);
  }
  for (int i = 0; i < 14; ++i) {  // cracks
    cv::Point at = AnyPoint(random, image);
    const double angle = random.Uniform(0, 6.3);
    for (int k = 0; k < 9; ++k) {
      const double turn = angle + random.Uniform(-0.7, 0.7), length = side / 40.0;
      const cv::Point next =
          at + cv::Point(cvRound(length * std::cos(turn)), cvRound(length * std::sin(turn)));
      cv::line(image, at, next, cv::Scalar::all(45), 1 + side / 700, cv::LINE_AA);
      at = next;
    }
  }
  return image;
}

cv::Mat DrawPaving(uint64_t seed, int side) {
  Random random(seed);
  cv::Mat image(side, side, CV_8UC3);
  constexpr int kSlabs = 8;
  const int step = side / kSlabs;
  for (int y = 0; y < kSlabs; ++y) {
    for (int x = 0; x < kSlabs; ++x) {
      cv::rectangle(image, {x * step, y * step, step, step},
                    cv::Scalar(150, 155, 160) * random.Uniform(0.82, 1.1), cv::FILLED);
      cv::rectangle(image, {x * step, y * step, step, step}, {95, 98, 100}, std::max(1, side / 256));
    }
  }
  AddOctaves(random, side / 8.0, 1, 6, image);
  for (int i = 0; i < side * side / 500; ++i) {
    const cv::Scalar grey = cv::Scalar::all(random.Uniform(70, 200));
    const int radius = static_cast<int>(random.Index(3));
    cv::circle(image, AnyPoint(random, image), radius, grey, cv::FILLED, cv::LINE_AA);
  }
  return image;
}

cv::Mat DrawLeaves(uint64_t seed, int side) {
  Random random(seed);
  const double r = 70 + random.Uniform(0, 40), g = 100 + random.Uniform(0, 40),
               b = 45 + random.Uniform(0, 30);
  const cv::Scalar green(b, g, r);
  cv::Mat image(side, side, CV_8UC3, green * 0.45);
  for (int i = 0; i < side * side / 40; ++i) {
    const cv::Scalar color = green * random.Uniform(0.35, 1.35);
    const double angle_deg = random.Uniform(0, 180);
    cv::ellipse(image, AnyPoint(random, image), {side / 40 + 1, side / 90 + 1}, angle_deg, 0, 360, color,
                cv::FILLED, cv::LINE_AA);
  }
  return image;
}

cv::Mat DrawBark(uint64_t seed, int side) {
  Random random(seed);
  cv::Mat image(side, side, CV_8UC3, cv::Scalar(62, 80, 96));
  AddOctaves(random, side / 4.0, 1, 9, image);
  for (int i = 0; i < side; ++i) {
    const cv::Point at = AnyPoint(random, image);
    const cv::Scalar color = cv::Scalar(30, 42, 52) * random.Uniform(0.5, 2);
    cv::line(image, at, at + cv::Point(static_cast<int>(random.Index(5)) - 2, side / 8), color, 2,
             cv::LINE_AA);
  }
  return image;
}

cv::Mat DrawSky(uint64_t seed, int width, int height) {
  Random random(seed);
  cv::Mat image(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) {
    const double down = std::clamp(2.0 * y / height, 0.0, 1.0);  // 1: horizon
    image.row(y) = cv::Scalar(235 - 5 * down, 185 + 42 * down, 135 + 85 * down);
  }
  // Clouds: soft, so that nothing in them is a corner. Three times as wide, so that the seam does not show.
  cv::Mat1f wide(height, 3 * width, 0.0f);
  for (int i = 0; i < 160; ++i) {
    const int y = static_cast<int>(random.Uniform(0.15, 0.49) * height),
              x = static_cast<int>(random.Index(width));
    const cv::Point at(x, y);
    const int high = cvRound(height * random.Uniform(0.008, 0.03)),
              wide_px = cvRound(width * random.Uniform(0.01, 0.05));
    const cv::Size radii(wide_px, high);
    const double share = random.Uniform(0.3, 0.8);
    for (int turn = 0; turn < 3; ++turn) {
      cv::ellipse(wide, at + cv::Point(turn * width, 0), radii, 0, 0, 360, share, cv::FILLED);
    }
  }
  cv::GaussianBlur(wide, wide, {}, width / 130.0);
  const cv::Mat1f cloud = wide(cv::Rect(width, 0, width, height));
  image.forEach<cv::Vec3b>([&](cv::Vec3b& pixel, const int* at) {
    const float share = std::min(cloud(at[0], at[1]), 0.9f);
    for (int k = 0; k < 3; ++k) pixel[k] = cv::saturate_cast<uint8_t>(pixel[k] + share * (245 - pixel[k]));
  });
  return image;
}

}  // namespace dynamic_slam
