#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

// Colours, BGR.
inline const cv::Scalar kInk(45, 40, 35);
inline const cv::Scalar kFaintInk(140, 135, 130);
inline const cv::Scalar kGridLine(233, 230, 228);
inline const cv::Scalar kTruthColour(130, 190, 255);     // light orange
inline const cv::Scalar kEstimateColour(190, 80, 30);    // blue
inline const cv::Scalar kLandmarkColour(165, 180, 130);  // teal

// A white picture for figures. Coordinates and sizes are px of the finished picture, which is drawn enlarged
// and then reduced, so that thin lines and OpenCV's plain letters come out smooth.
class Canvas {
 public:
  Canvas(int width_px, int height_px);

  enum class Align { kLeft, kCentre, kRight };

  void Line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const cv::Scalar& colour,
            double width_px);
  // A position that is not finite breaks the line.
  void Polyline(const std::vector<Eigen::Vector2d>& positions, const cv::Scalar& colour, double width_px);
  void Disc(const Eigen::Vector2d& centre, double radius_px, const cv::Scalar& colour);
  void Circle(const Eigen::Vector2d& centre, double radius_px, const cv::Scalar& colour, double width_px);
  // The box's border.
  void Box(const Eigen::Vector2d& top_left, double width_px, double height_px, const cv::Scalar& colour);
  // Capital letters are height_px high and stand on `position`. ASCII only.
  void Text(const std::string& text, const Eigen::Vector2d& position, double height_px,
            const cv::Scalar& colour, Align align = Align::kLeft);
  static double TextWidth(const std::string& text, double height_px);
  // image: CV_8UC1 or CV_8UC3, scaled to the box.
  void Image(const cv::Mat& image, const Eigen::Vector2d& top_left, double width_px, double height_px);

  // CV_8UC3.
  cv::Mat Finish() const;

  int width() const { return width_px_; }
  int height() const { return height_px_; }

 private:
  int width_px_, height_px_;
  cv::Mat enlarged_;
};

// Throws InputError when the file cannot be written.
void WritePicture(const std::string& file, const cv::Mat& picture);

}  // namespace dynamic_slam
