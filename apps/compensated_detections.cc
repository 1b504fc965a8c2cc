#include "compensated_detections.h"

#include "dynamic_slam/semantics/detection_exchange.h"

namespace dynamic_slam {
namespace {

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
  if (open_ && IsAnswerDue(open_->timestamp_s + latency_s_, timestamp_s)) {
    compensation_->UpdateLate(open_->frame, open_->detections);
    open_.reset();
  }
  CompensationInput input{frame, timestamp_s, {}, {}, motion_.Update(image)};
  if (latency_s_ <= 0) {
    input.detections = detections;
  } else if (!open_) {
    open_ = {frame, timestamp_s, detections};
  }
  return compensation_->Update(input);
}

}  // namespace dynamic_slam
