#include "dynamic_slam/semantics/hog_detector.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>
#include <opencv2/objdetect.hpp>

#include "dynamic_slam/semantics/sanitise.h"

namespace dynamic_slam {
namespace {

class HogDetector : public Detector {
 public:
  HogDetector() : Detector("hog", {"person"}) {
    hog_.setSVMDetector(cv::HOGDescriptor::getDefaultPeopleDetector());
  }

 private:
  std::vector<Detection> Find(const cv::Mat& image, FrameId, double) override {
    // Lowest distance to the support vector machine's plane that counts, and the overlap of what is one
    // person. OpenCV's own grouping depends on the order in which its threads find the windows.
    constexpr double kMinDistance = 0.4, kMaxIoU = 0.3, kScaleStep = 1.05;
    if (image.cols < hog_.winSize.width || image.rows < hog_.winSize.height) return {};
    std::vector<cv::Rect> windows;
    std::vector<double> distances;
    hog_.detectMultiScale(image, windows, distances, kMinDistance, cv::Size(8, 8), cv::Size(), kScaleStep, 0);
    std::vector<Detection> detections;
    for (size_t i = 0; i < windows.size(); ++i) {
      // The windows that it was trained on have a margin around the person.
      constexpr double kMarginX = 0.1, kMarginY = 0.07, kKept = 0.8;
      const cv::Rect& window = windows[i];
      const Box box{window.x + kMarginX * window.width, window.y + kMarginY * window.height,
                    kKept * window.width, kKept * window.height};
      // A distance is no probability; this one only keeps its order and lies in 0 to 1.
      detections.push_back({box, 0, 1 - std::exp(-distances[i])});
    }
    return SuppressNonMaxima(std::move(detections), kMaxIoU);
  }

  cv::HOGDescriptor hog_;
};

}  // namespace

std::unique_ptr<Detector> MakeHogDetector() { return std::make_unique<HogDetector>(); }

}  // namespace dynamic_slam
