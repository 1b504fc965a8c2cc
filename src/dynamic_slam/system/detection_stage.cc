#include "dynamic_slam/system/detection_stage.h"

#include <chrono>
#include <utility>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/stopwatch.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/semantics/dynamic_prior.h"

namespace dynamic_slam {
namespace {

using Clock = std::chrono::steady_clock;

}  // namespace

DetectionStage::DetectionStage(std::shared_ptr<Detector> detector, const DetectionOptions& options,
                               const Camera& camera, Executor* executor)
    : detector_(std::move(detector)),
      options_(options),
      executor_(executor),
      compensation_(MakeBoxCompensation(options.compensation, camera)),
      score_(options.score, ClassScores(LoadDynamicPrior(options.prior), detector_->class_names())),
      shared_(std::make_shared<Shared>()) {}

bool DetectionStage::Begin(FrameId frame, double timestamp_s) {
  failure_.clear();
  told_late_ = FrameId();
  if (const std::optional<DetectionResult> answer = TakeAnswer(timestamp_s, 0)) {
    ++report_.late;
    if (compensation_->UpdateLate(answer->frame, answer->detections)) told_late_ = answer->frame;
  }
  return !open_.has_value() && frame.value() % static_cast<uint32_t>(options_.every) == 0;
}

void DetectionStage::Submit(FrameId frame, double timestamp_s, const cv::Mat& image) {
  DS_CHECK(!open_.has_value(), "frame={} open={}", frame.value(), open_->frame.value());
  open_ = {frame, timestamp_s, timestamp_s + 1e-3 * options_.latency_ms};
  ++report_.asked;
  // The task owns all that it touches: a network that hangs may outlive the system.
  executor_->Post(Lane::kDetection, [detector = detector_, shared = shared_, frame, timestamp_s,
                                     image](const std::stop_token&) {
    DS_TRACE("detection");
    const Clock::time_point start = Clock::now();
    DetectionResult result;
    result.frame = frame;
    try {
      result.detections = detector->Detect(image, frame, timestamp_s);
    } catch (const std::exception& error) {
      result.failure = error.what();
    } catch (...) {
      result.failure = "the detector failed without a reason";
    }
    shared->times_ms.Write()->push_back(MillisecondsSince(start));
    shared->exchange.Write(std::move(result));
  });
}

std::optional<DetectionResult> DetectionStage::TakeAnswer(double timestamp_s, double patience_ms) {
  if (!open_.has_value()) return std::nullopt;
  if (!answer_.has_value()) {
    const auto patience = std::chrono::duration<double, std::milli>(patience_ms);
    answer_ = shared_->exchange.Read(open_->frame,
                                     Clock::now() + std::chrono::duration_cast<Clock::duration>(patience));
  }
  if (!answer_.has_value() || !IsAnswerDue(open_->answer_due_s, timestamp_s)) return std::nullopt;
  told_to_ = open_->frame;
  open_.reset();
  std::optional<DetectionResult> answer = std::exchange(answer_, std::nullopt);
  if (answer->failure.empty()) return answer;
  ++report_.failed;
  failure_ = report_.last_failure = answer->failure;
  return std::nullopt;
}

FrameObjects DetectionStage::Collect(FrameId frame, double timestamp_s,
                                     const std::optional<Eigen::Quaterniond>& cam_from_last,
                                     std::span<const PointMotion> motions) {
  DS_TRACE("detection/collect");
  FrameObjects objects;
  CompensationInput input;
  input.frame = frame;
  input.timestamp_s = timestamp_s;
  input.cam_from_last = cam_from_last;
  input.motions.assign(motions.begin(), motions.end());
  objects.state = DetectionState::kNotAsked;
  if (open_.has_value() && open_->frame == frame) {
    objects.state = DetectionState::kLate;
    if (std::optional<DetectionResult> answer = TakeAnswer(timestamp_s, options_.deadline_ms)) {
      ++report_.on_time;
      objects.state = DetectionState::kOnTime;
      input.detections = std::move(answer->detections);
    }
  }
  if (!failure_.empty()) {
    objects.state = DetectionState::kFailed;
    objects.reason = failure_;
  }
  objects.boxes = score_.Update(compensation_->Update(std::move(input)));
  objects.untold_from = UntoldFrom(timestamp_s);
  objects.told_to = told_to_;
  if (told_late_.IsValid()) objects.late = NewlyTold(told_late_);
  return objects;
}

FrameId DetectionStage::UntoldFrom(double timestamp_s) const {
  const bool is_awaited = open_.has_value() && timestamp_s - open_->asked_s < options_.first_answer_s;
  return is_awaited ? open_->frame : FrameId();
}

std::vector<LateObjects> DetectionStage::NewlyTold(FrameId told) const {
  std::vector<LateObjects> late;
  for (const FrameBoxes& earlier : compensation_->EarlierBoxes(told)) {
    LateObjects objects{earlier.frame, {}};
    for (const CompensatedBox& box : earlier.boxes) {
      const bool is_new = box.age_frames == static_cast<int>(earlier.frame.value() - told.value()) + 1;
      if (is_new) objects.boxes.push_back(score_.Judge(box));
    }
    if (!objects.boxes.empty()) late.push_back(std::move(objects));
  }
  return late;
}

void DetectionStage::SetRotation(FrameId frame, const Eigen::Quaterniond& cam_from_last) {
  DS_TRACE("detection/rotation");
  compensation_->UpdateRotation(frame, cam_from_last);
}

void DetectionStage::Reset() {
  compensation_->Reset();
  score_.Reset();
  shared_ = std::make_shared<Shared>();
  open_.reset();
  answer_.reset();
  failure_.clear();
  told_to_ = told_late_ = FrameId();
  report_ = DetectionReport();
}

DetectionReport DetectionStage::report() const {
  DetectionReport report = report_;
  report.times_ms = *shared_->times_ms.Read();
  return report;
}

}  // namespace dynamic_slam
