#include "compensated_detections.h"

namespace dynamic_slam {
namespace {

constexpr double kStampTolerance_s = 1e-4;

std::unique_ptr<BoxCompensation> Make(const std::string& method, const Camera& camera) {
  CompensationOptions options;
  options.method = method;
  return MakeBoxCompensation(options, camera);
}

}  // namespace

CompensatedDetections::CompensatedDetections(const std::string& method, const Camera& camera,
                                             double latency_s)
    : compensation_(Make(method, camera)), latency_s_(latency_s) {}

std::vector<CompensatedBox> CompensatedDetections::Update(FrameId frame, double timestamp_s,
                                                          const cv::Mat& image,
                                                          const std::vector<Detection>& detections) {
  CompensationInput input{frame, timestamp_s, {}, {}, motion_.Update(image)};
  if (latency_s_ <= 0) {
    input.detections = detections;
    return compensation_->Update(input);
  }
  compensation_->Update(input);
  under_way_.push_back({frame, timestamp_s, detections});
  while (!under_way_.empty() &&
         under_way_.front().timestamp_s + latency_s_ <= timestamp_s + kStampTolerance_s) {
    compensation_->UpdateLate(under_way_.front().frame, under_way_.front().detections);
    under_way_.pop_front();
  }
  return compensation_->Boxes();
}

}  // namespace dynamic_slam
