#include "dynamic_slam/sim/car.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <opencv2/imgproc.hpp>

#include "dynamic_slam/sim/color_materials.h"
#include "dynamic_slam/sim/furniture.h"
#include "dynamic_slam/sim/texture.h"

namespace dynamic_slam {
namespace {

// The outline from the side, x ahead from the rear bumper, in shares of length and height: where bonnet,
// windscreen, roof and boot begin and end.
struct Shape {
  double length_m, width_m, height_m;
  double bonnet, screen_foot, roof_front, roof_rear, rear_foot;  // x, shares of the length
  double bonnet_up, belt_up, boot_up;                            // z, shares of the height
};

constexpr Shape kShapes[] = {
    {4.0, 1.74, 1.48, 0.985, 0.74, 0.58, 0.16, 0.04, 0.58, 0.63, 0.62},   // hatchback
    {4.6, 1.80, 1.44, 0.985, 0.72, 0.56, 0.30, 0.17, 0.59, 0.63, 0.65},   // saloon
    {4.6, 1.82, 1.50, 0.985, 0.73, 0.58, 0.10, 0.03, 0.60, 0.64, 0.63},   // estate
    {4.5, 1.86, 1.68, 0.98, 0.76, 0.62, 0.10, 0.035, 0.60, 0.64, 0.63},   // off-roader
    {4.9, 1.92, 1.95, 0.985, 0.86, 0.72, 0.03, 0.015, 0.55, 0.58, 0.58},  // van
};

constexpr double kSill = 0.20;  // m above the road

// Height of the upper outline at a share of the length.
double TopAt(const Shape& s, double share) {
  const std::array<std::pair<double, double>, 8> line = {{{0.0, 0.45},
                                                          {0.012, s.boot_up},
                                                          {s.rear_foot, s.boot_up + 0.03},
                                                          {s.roof_rear, 0.97},
                                                          {0.5 * (s.roof_rear + s.roof_front), 1.0},
                                                          {s.roof_front, 0.965},
                                                          {s.screen_foot, s.belt_up},
                                                          {s.bonnet, s.bonnet_up - 0.09}}};
  if (share >= s.bonnet)
    return s.height_m * (s.bonnet_up - 0.09 - 0.16 * (share - s.bonnet) / (1 - s.bonnet));
  size_t i = 0;
  while (i + 2 < line.size() && line[i + 1].first < share) ++i;
  const double t =
      std::clamp((share - line[i].first) / std::max(line[i + 1].first - line[i].first, 1e-6), 0.0, 1.0);
  return s.height_m * (line[i].second + t * (line[i + 1].second - line[i].second));
}

constexpr int kPicture = 512;  // texels along the car

struct Paint {
  cv::Scalar body, glass{52, 46, 40};
  bool van;
};

// What the side looks like: doors, windows, wheel arches. Its x is the length from the rear, y the height
// downwards.
cv::Mat DrawSide(Random& random, const Shape& s, const Paint& paint, double front_axle, double rear_axle,
                 double wheel_radius) {
  const int rows = kPicture / 2;
  cv::Mat image(rows, kPicture, CV_8UC3, paint.body);
  const auto at = [&](double share, double up_m) {
    return cv::Point(cvRound(share * kPicture), cvRound(rows * (1 - up_m / s.height_m)));
  };
  const double belt = s.belt_up * s.height_m;
  for (int y = 0; y < rows; ++y) {  // the sky above, the road below in the paint
    const double up = 1 - static_cast<double>(y) / rows;
    const double shine = up > 0.45 ? 1.0 + 0.25 * (up - 0.45) : 0.75 + 0.55 * up;
    image.row(y) = cv::Scalar(paint.body * shine);
  }
  // Windows, a little inside the outline.
  const double front = s.screen_foot - 0.03, rear = s.rear_foot + 0.035;
  const auto edge = [&](double share, double down) { return at(share, TopAt(s, share) - down); };
  std::vector<cv::Point> pane = {at(rear, belt + 0.02)};
  if (paint.van) pane[0] = at(s.roof_front - 0.10, belt + 0.02);
  const double first = paint.van ? s.roof_front - 0.10 : std::max(rear + 0.015, s.roof_rear + 0.01);
  for (double x = first; x < s.roof_front; x += 0.02) pane.push_back(edge(x, 0.10));
  pane.push_back(edge(s.roof_front, 0.09));
  pane.push_back(at(front, belt + 0.02));
  cv::fillPoly(image, std::vector<std::vector<cv::Point>>{pane}, paint.glass, cv::LINE_AA);
  for (int i = 0; i < 5; ++i) {  // what is reflected
    const double x = random.Uniform(first, front);
    const cv::Size size(static_cast<int>(6 + random.Index(22)), 8);
    const cv::Rect streak(at(x, belt + random.Uniform(0.1, 0.3)), size);
    cv::Mat inside = image(streak & cv::Rect(0, 0, image.cols, image.rows));
    inside.forEach<cv::Vec3b>([&](cv::Vec3b& pixel, const int*) {
      if (pixel == cv::Vec3b(52, 46, 40)) pixel = cv::Vec3b(105, 98, 88);
    });
  }
  const cv::Scalar gap = paint.body * 0.35, trim(35, 35, 35);
  const double middle = 0.5 * (s.roof_front + s.roof_rear) - 0.01;
  for (const double x : {s.screen_foot - 0.02, middle, rear + 0.06}) {
    if (paint.van && x < middle) continue;
    cv::line(image, at(x, belt), at(x, kSill + 0.08), gap, 2, cv::LINE_AA);
    if (x > rear + 0.07) {
      cv::line(image, at(std::min(x, s.roof_front - 0.02), s.height_m * 0.95), at(x, belt), paint.body * 0.7,
               5, cv::LINE_AA);
      cv::rectangle(image, at(x - 0.055, belt - 0.08), at(x - 0.02, belt - 0.11), trim, cv::FILLED);
    }
  }
  cv::rectangle(image, at(0, kSill + 0.10), at(1, 0), trim, cv::FILLED);
  cv::line(image, at(0, 0.52 * belt + 0.1), at(1, 0.52 * belt + 0.1), paint.body * 0.6, 2, cv::LINE_AA);
  for (const double axle : {front_axle, rear_axle}) {
    const cv::Size radii(cvRound(1.16 * wheel_radius / s.length_m * kPicture),
                         cvRound(1.16 * wheel_radius / s.height_m * rows));
    cv::ellipse(image, at(axle, wheel_radius), radii, 0, 0, 360, cv::Scalar::all(14), cv::FILLED,
                cv::LINE_AA);
  }
  cv::rectangle(image, at(0.955, 0.60 * belt + 0.14), at(1, 0.60 * belt), {225, 235, 235}, cv::FILLED);
  cv::rectangle(image, at(0, 0.72 * belt + 0.16), at(0.03, 0.72 * belt), {30, 30, 170}, cv::FILLED);
  return image;
}

// What the front or the rear looks like: x across, y downwards.
cv::Mat DrawEnd(Random& random, const Shape& s, const Paint& paint, bool front) {
  cv::Mat image(256, 256, CV_8UC3, paint.body);
  const auto y_of = [&](double up_m) { return cvRound(256 * (1 - up_m / s.height_m)); };
  const double belt = s.belt_up * s.height_m;
  const std::vector<cv::Point> pane = {{34, y_of(belt + 0.03)},
                                       {222, y_of(belt + 0.03)},
                                       {196, y_of(s.height_m - 0.09)},
                                       {60, y_of(s.height_m - 0.09)}};
  cv::fillPoly(image, std::vector<std::vector<cv::Point>>{pane}, paint.glass, cv::LINE_AA);
  const cv::Scalar lamp = front ? cv::Scalar(235, 240, 240) : cv::Scalar(35, 30, 185);
  const double lamp_up = front ? 0.52 * belt + 0.2 : 0.62 * belt + 0.2;
  for (const int x : {0, 204})
    cv::rectangle(image, {x, y_of(lamp_up), 52, 256 - y_of(front ? 0.13 : 0.2)}, lamp, cv::FILLED);
  if (front)
    cv::rectangle(image, cv::Point(60, y_of(lamp_up - 0.02)), cv::Point(196, y_of(lamp_up - 0.17)),
                  cv::Scalar::all(28), cv::FILLED);
  cv::rectangle(image, cv::Point(0, y_of(kSill + 0.16)), cv::Point(256, 256), cv::Scalar::all(38),
                cv::FILLED);
  const cv::Rect plate(92, y_of(front ? 0.5 : 0.72), 72, 17);
  cv::rectangle(image, plate, cv::Scalar(235, 240, 240), cv::FILLED);
  std::string text;
  for (int i = 0; i < 7; ++i)
    text += static_cast<char>(i == 2 ? ' ' : (i < 4 ? 'A' + random.Index(26) : '0' + random.Index(10)));
  cv::putText(image, text, {95, plate.y + 13}, cv::FONT_HERSHEY_SIMPLEX, 0.42, {20, 20, 20}, 1, cv::LINE_AA);
  return image;
}

cv::Mat DrawWheel(Random& random) {
  cv::Mat image(128, 128, CV_8UC3, cv::Scalar::all(24));
  cv::circle(image, {64, 64}, 42, cv::Scalar::all(random.Uniform(120, 200)), cv::FILLED, cv::LINE_AA);
  const int spokes = 5 + static_cast<int>(random.Index(4));
  for (int i = 0; i < spokes; ++i) {
    const double angle = 2 * std::numbers::pi * (i + 0.5) / spokes;
    cv::ellipse(image, {cvRound(64 + 26 * std::cos(angle)), cvRound(64 + 26 * std::sin(angle))}, {11, 6},
                angle * 180 / std::numbers::pi, 0, 360, cv::Scalar::all(30), cv::FILLED, cv::LINE_AA);
  }
  cv::circle(image, {64, 64}, 7, cv::Scalar::all(90), cv::FILLED, cv::LINE_AA);
  return image;
}

}  // namespace

Car::Car(uint64_t seed) {
  Random random(seed);
  const uint32_t kind = random.Index(std::size(kShapes));
  Shape shape = kShapes[kind];
  shape.length_m *= random.Uniform(0.96, 1.04);
  shape.height_m *= random.Uniform(0.98, 1.03);
  length_m_ = shape.length_m;
  width_m_ = shape.width_m;
  wheel_radius_m_ = kind >= 3 ? 0.35 : 0.31;
  front_axle_m_ = length_m_ * (0.81 - 0.5);
  rear_axle_m_ = length_m_ * (0.185 - 0.5);
  const cv::Scalar colors[] = {{225, 228, 228}, {190, 192, 192}, {115, 116, 118}, {42, 40, 40},
                               {35, 30, 150},   {130, 70, 35},   {80, 50, 25},    {60, 90, 50},
                               {30, 110, 190},  {150, 165, 175}};
  const double light = random.Uniform(0.85, 1.1);
  const Paint paint{colors[random.Index(std::size(colors))] * light, {52, 46, 40}, kind == 4};

  auto body = std::make_shared<Mesh>();
  Surface side_paint = Painted(DrawSide(random, shape, paint, 0.81, 0.185, wheel_radius_m_));
  const int side = body->AddSurface(side_paint);
  const int front = body->AddSurface(Painted(DrawEnd(random, shape, paint, true)));
  const int rear = body->AddSurface(Painted(DrawEnd(random, shape, paint, false)));
  const int skin = body->AddSurface(Painted(DrawPlain(SubSeed(seed, 1), 64, paint.body, 2)));
  const int glass = body->AddSurface(Painted(DrawPlain(SubSeed(seed, 2), 64, paint.glass * 1.35, 8)));
  const int under = body->AddSurface(Painted(DrawPlain(SubSeed(seed, 3), 16, cv::Scalar::all(18), 2)));

  // Sections across, each a line from the sill over the belt to the roof; the left side mirrors the right
  // one.
  const double belt = shape.belt_up * shape.height_m;
  std::vector<double> stations = {0,
                                  0.012,
                                  shape.rear_foot,
                                  shape.roof_rear,
                                  0.5 * (shape.roof_rear + shape.roof_front),
                                  shape.roof_front,
                                  shape.screen_foot,
                                  0.5 * (shape.screen_foot + shape.bonnet),
                                  shape.bonnet,
                                  1.0};
  for (const double x : {0.05, 0.1, 0.25, 0.45, 0.94}) stations.push_back(x);
  std::sort(stations.begin(), stations.end());
  constexpr int kLevels = 5;
  struct Section {
    double x;
    std::array<double, kLevels> half, up;
  };
  std::vector<Section> sections;
  for (const double share : stations) {
    const double top = TopAt(shape, share), end = std::min(share, 1 - share);
    const double half = 0.5 * width_m_ * (1 - 0.16 * std::pow(std::max(0.0, 1 - end / 0.09), 2.0));
    const double waist = std::min(belt, top);
    const double lean = 0.20 * std::max(0.0, top - belt) / (shape.height_m - belt);  // of the windows, m
    Section section{(share - 0.5) * length_m_, {}, {}};
    section.up = {kSill, 0.5 * (kSill + waist), waist - 0.01, std::max(waist, top - 0.07), top};
    section.half = {0.96 * half, half, 0.985 * half, 0.985 * half - lean,
                    top > belt + 0.1 ? 0.985 * half - lean - 0.10 : 0.93 * half};
    sections.push_back(section);
  }
  const auto uv_side = [&](const Section& s, int level) {
    return Eigen::Vector2d(s.x / length_m_ + 0.5, 1 - s.up[level] / shape.height_m);
  };
  for (const double sign : {-1.0, 1.0}) {
    for (size_t i = 0; i + 1 < sections.size(); ++i) {
      const Section &a = sections[i], &b = sections[i + 1];
      for (int level = 0; level + 1 < kLevels; ++level) {
        const Eigen::Vector3d normal(0, sign, level >= 2 ? 0.45 : level == 0 ? -0.15 : 0.1);
        const auto add = [&](const Section& s, int l) {
          return body->AddPoint({s.x, sign * s.half[l], s.up[l]}, normal, uv_side(s, l));
        };
        const int p = add(a, level), q = add(b, level), r = add(b, level + 1), t = add(a, level + 1);
        if (sign < 0) {
          body->triangles.push_back({{p, q, r}, side});
          body->triangles.push_back({{p, r, t}, side});
        } else {
          body->triangles.push_back({{p, r, q}, side});
          body->triangles.push_back({{p, t, r}, side});
        }
      }
    }
  }
  for (size_t i = 0; i + 1 < sections.size(); ++i) {  // along the top
    const Section &a = sections[i], &b = sections[i + 1];
    const double rise = (b.up[kLevels - 1] - a.up[kLevels - 1]) / (b.x - a.x);
    const Eigen::Vector3d normal(-rise, 0, 1);
    const double middle = 0.5 * (a.x + b.x) / length_m_ + 0.5;
    const bool pane = std::abs(rise) > 0.2 && middle > shape.rear_foot && middle < shape.screen_foot &&
                      !(paint.van && middle < 0.5);
    const auto add = [&](const Section& s, double sign) {
      return body->AddPoint({s.x, sign * s.half[kLevels - 1], s.up[kLevels - 1]}, normal,
                            {0.5 + 0.5 * sign, s.x});
    };
    const int p = add(a, -1), q = add(b, -1), r = add(b, 1), t = add(a, 1);
    body->triangles.push_back({{p, q, r}, pane ? glass : skin});
    body->triangles.push_back({{p, r, t}, pane ? glass : skin});
  }
  for (const bool is_front : {false, true}) {  // the ends
    const Section& s = is_front ? sections.back() : sections.front();
    const double sign = is_front ? 1 : -1;
    for (int level = 0; level + 1 < kLevels; ++level) {
      const auto add = [&](double side_sign, int l) {
        return body->AddPoint({s.x, side_sign * s.half[l], s.up[l]}, {sign, 0.3 * side_sign, 0.1},
                              {0.5 + sign * side_sign * s.half[l] / width_m_, 1 - s.up[l] / shape.height_m});
      };
      const int p = add(-sign, level), q = add(sign, level), r = add(sign, level + 1),
                t = add(-sign, level + 1);
      body->triangles.push_back({{p, q, r}, is_front ? front : rear});
      body->triangles.push_back({{p, r, t}, is_front ? front : rear});
    }
  }
  const double half_length = 0.49 * length_m_, half_width = 0.46 * width_m_;
  body->AddQuad(under, {-half_length, -half_width, kSill}, {2 * half_length, 0, 0}, {0, 2 * half_width, 0});
  for (const double sign : {-1.0, 1.0}) {  // mirrors
    body->AddEllipsoid(skin,
                       {(shape.screen_foot - 0.545) * length_m_, sign * (0.5 * width_m_ + 0.07), belt + 0.06},
                       {0.06, 0.10, 0.07}, 8, 5);
  }
  body_ = body;

  auto wheel = std::make_shared<Mesh>();  // about the hub, the outside along -y
  const int tyre = wheel->AddSurface(Painted(DrawPlain(SubSeed(seed, 4), 32, cv::Scalar::all(26), 5)));
  const int rim = wheel->AddSurface(Painted(DrawWheel(random)));
  const double r = wheel_radius_m_;
  const std::vector<Mesh::Ring> rings = {{{0, 0.2, 0}, 0.9 * r, 0.9 * r},
                                         {{0, 0.17, 0}, r, r},
                                         {{0, 0.03, 0}, r, r},
                                         {{0, 0.0, 0}, 0.93 * r, 0.93 * r}};
  wheel->AddLoft(tyre, rings, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitZ(), 20);
  constexpr int kCorners = 20;
  const int hub = wheel->AddPoint({0, -0.006, 0}, {0, -1, 0}, {0.5, 0.5});
  for (int i = 0; i <= kCorners; ++i) {
    const double angle = 2 * std::numbers::pi * i / kCorners, c = std::cos(angle), s = std::sin(angle);
    const int point =
        wheel->AddPoint({0.93 * r * c, -0.006, 0.93 * r * s}, {0, -1, 0}, {0.5 + 0.46 * c, 0.5 - 0.46 * s});
    if (i > 0) wheel->triangles.push_back({{hub, point - 1, point}, rim});
  }
  wheel_ = wheel;
}

void Car::Place(const Eigen::Vector2d& position, double heading_rad, double rolled_m, int object,
                std::vector<MeshInstance>* instances, std::vector<GroundShadow>* shadows) const {
  const Rigid3 world_from_car(ExpSo3({0, 0, heading_rad}), {position.x(), position.y(), 0});
  instances->emplace_back(body_, world_from_car, object);
  for (const double x : {front_axle_m_, rear_axle_m_}) {
    for (const double sign : {-1.0, 1.0}) {
      const Eigen::Quaterniond outward = ExpSo3({0, 0, sign > 0 ? std::numbers::pi : 0.0});
      const Eigen::Quaterniond roll =
          ExpSo3({0, (sign > 0 ? -1 : 1) * std::fmod(rolled_m / wheel_radius_m_, 2 * std::numbers::pi), 0});
      const Rigid3 car_from_wheel(outward * roll, {x, sign * (0.5 * width_m_ + 0.005), wheel_radius_m_});
      instances->emplace_back(wheel_, world_from_car * car_from_wheel, object, 60.0f);
    }
  }
  if (shadows != nullptr) {
    const float c = static_cast<float>(std::cos(heading_rad)), s = static_cast<float>(std::sin(heading_rad));
    shadows->push_back({position.cast<float>(), Eigen::Vector2f(c, s) * static_cast<float>(0.62 * length_m_),
                        Eigen::Vector2f(-s, c) * static_cast<float>(0.75 * width_m_)});
  }
}

}  // namespace dynamic_slam
