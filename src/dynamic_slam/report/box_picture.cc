#include "dynamic_slam/report/box_picture.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

namespace dynamic_slam {

void DrawBox(const Box& box, const std::string& label, const cv::Scalar& colour, cv::Mat* image) {
  // Sizes for a width of 640 px.
  const double unit = std::max(1.0, image->cols / 640.0);
  const int line_px = static_cast<int>(std::lround(2 * unit));
  const cv::Rect border(static_cast<int>(std::lround(box.x)), static_cast<int>(std::lround(box.y)),
                        static_cast<int>(std::lround(box.width)), static_cast<int>(std::lround(box.height)));
  cv::rectangle(*image, border, colour, line_px, cv::LINE_AA);

  const double font_scale = 0.45 * unit;
  const int thickness = static_cast<int>(std::lround(unit)), margin = static_cast<int>(std::lround(4 * unit));
  int below = 0;
  const cv::Size text = cv::getTextSize(label, cv::FONT_HERSHEY_SIMPLEX, font_scale, thickness, &below);
  cv::Rect plate(border.x - line_px / 2, 0, text.width + 2 * margin, text.height + below + margin);
  plate.y = border.y - plate.height;
  if (plate.y < 0) plate.y = border.y;  // inside, where there is no room above
  plate.x = std::max(0, std::min(plate.x, image->cols - plate.width));
  cv::rectangle(*image, plate, colour, cv::FILLED);
  cv::putText(*image, label, {plate.x + margin, plate.y + margin / 2 + text.height}, cv::FONT_HERSHEY_SIMPLEX,
              font_scale, cv::Scalar::all(255), thickness, cv::LINE_AA);
}

}  // namespace dynamic_slam
