#include "dynamic_slam/eval/canvas.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

constexpr int kEnlargement = 3;
constexpr int kShift = 4;  // OpenCV draws at 1/16 px
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kFontCapitalsPx = 21;  // at font scale 1

cv::Point ToPoint(const Eigen::Vector2d& position) {
  // Half a pixel: positions are of pixel edges, OpenCV's of pixel centres.
  const Eigen::Vector2d shifted = ((position * kEnlargement).array() - 0.5) * (1 << kShift);
  return {static_cast<int>(std::lround(shifted.x())), static_cast<int>(std::lround(shifted.y()))};
}

int Width(double width_px) { return std::max(1, static_cast<int>(std::lround(width_px * kEnlargement))); }

double FontScale(double height_px) { return height_px * kEnlargement / kFontCapitalsPx; }

// Strokes an eighth of the letters' height thick.
int FontThickness(double height_px) { return Width(height_px / 8); }

}  // namespace

Canvas::Canvas(int width_px, int height_px)
    : width_px_(width_px),
      height_px_(height_px),
      enlarged_(height_px * kEnlargement, width_px * kEnlargement, CV_8UC3, cv::Scalar::all(255)) {}

void Canvas::Line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const cv::Scalar& colour,
                  double width_px) {
  cv::line(enlarged_, ToPoint(from), ToPoint(to), colour, Width(width_px), cv::LINE_AA, kShift);
}

void Canvas::Polyline(const std::vector<Eigen::Vector2d>& positions, const cv::Scalar& colour,
                      double width_px) {
  for (size_t i = 1; i < positions.size(); ++i) {
    if (positions[i - 1].allFinite() && positions[i].allFinite())
      Line(positions[i - 1], positions[i], colour, width_px);
  }
}

void Canvas::Disc(const Eigen::Vector2d& centre, double radius_px, const cv::Scalar& colour) {
  const int radius = static_cast<int>(std::lround(radius_px * kEnlargement * (1 << kShift)));
  cv::circle(enlarged_, ToPoint(centre), radius, colour, cv::FILLED, cv::LINE_AA, kShift);
}

void Canvas::Circle(const Eigen::Vector2d& centre, double radius_px, const cv::Scalar& colour,
                    double width_px) {
  const int radius = static_cast<int>(std::lround(radius_px * kEnlargement * (1 << kShift)));
  cv::circle(enlarged_, ToPoint(centre), radius, colour, Width(width_px), cv::LINE_AA, kShift);
}

void Canvas::Box(const Eigen::Vector2d& top_left, double width_px, double height_px,
                 const cv::Scalar& colour) {
  cv::rectangle(enlarged_, ToPoint(top_left), ToPoint(top_left + Eigen::Vector2d(width_px, height_px)),
                colour, Width(1), cv::LINE_AA, kShift);
}

double Canvas::TextWidth(const std::string& text, double height_px) {
  return static_cast<double>(
             cv::getTextSize(text, kFont, FontScale(height_px), FontThickness(height_px), nullptr).width) /
         kEnlargement;
}

void Canvas::Text(const std::string& text, const Eigen::Vector2d& position, double height_px,
                  const cv::Scalar& colour, Align align) {
  const double part = align == Align::kLeft ? 0 : align == Align::kCentre ? 0.5 : 1;
  const Eigen::Vector2d origin =
      kEnlargement * (position - Eigen::Vector2d(part * TextWidth(text, height_px), 0));
  cv::putText(enlarged_, text, {static_cast<int>(origin.x()), static_cast<int>(origin.y())}, kFont,
              FontScale(height_px), colour, FontThickness(height_px), cv::LINE_AA);
}

void Canvas::Image(const cv::Mat& image, const Eigen::Vector2d& top_left, double width_px, double height_px) {
  cv::Mat colour;
  if (image.channels() == 1) {
    cv::cvtColor(image, colour, cv::COLOR_GRAY2BGR);
  } else {
    colour = image;
  }
  const cv::Size size(static_cast<int>(width_px * kEnlargement), static_cast<int>(height_px * kEnlargement));
  const cv::Rect box(
      {static_cast<int>(top_left.x() * kEnlargement), static_cast<int>(top_left.y() * kEnlargement)}, size);
  cv::resize(colour, enlarged_(box), size, 0, 0, size.width < image.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
}

cv::Mat Canvas::Finish() const {
  cv::Mat picture;
  cv::resize(enlarged_, picture, {width_px_, height_px_}, 0, 0, cv::INTER_AREA);
  return picture;
}

void WritePicture(const std::string& file, const cv::Mat& picture) {
  std::vector<uchar> bytes;
  const auto refuse = [&file](const std::string& reason) {
    throw InputError(file, "cannot be written" + reason,
                     "Choose another folder with --out, or free some space.");
  };
  try {
    cv::imencode(std::filesystem::path(file).extension().string(), picture, bytes,
                 {cv::IMWRITE_PNG_COMPRESSION, 9});
  } catch (const cv::Exception&) {
    refuse("");
  }
  // Not by OpenCV, which does not hear of a disk that is full.
  errno = 0;
  std::ofstream stream(file, std::ios::binary);
  stream.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (stream) return;
  const std::string reason = errno != 0 ? fmt::format(" ({})", std::strerror(errno)) : "";
  std::error_code ignored;
  if (std::filesystem::is_regular_file(file, ignored)) std::filesystem::remove(file, ignored);  // half of it
  refuse(reason);
}

}  // namespace dynamic_slam
