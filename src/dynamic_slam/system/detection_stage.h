#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>

#include "dynamic_slam/base/guarded.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/semantics/box_compensation.h"
#include "dynamic_slam/semantics/detection_exchange.h"
#include "dynamic_slam/semantics/detector.h"
#include "dynamic_slam/semantics/dynamic_score.h"
#include "dynamic_slam/semantics/frame_objects.h"
#include "dynamic_slam/system/detection_options.h"
#include "dynamic_slam/system/executor.h"

namespace dynamic_slam {

// What the detector has done so far.
struct DetectionReport {
  int asked = 0, on_time = 0, late = 0, failed = 0;
  std::string last_failure;
  std::vector<double> times_ms;  // of the detector
};

// The detector beside tracking (section 3.3): asked about a frame while tracking extracts its features, read
// when tracking needs the boxes, never waited for beyond a deadline. A missing result is a missed detection,
// which the compensation covers (section 3.1); when it comes later, it still corrects the compensation.
//
// One frame at a time is with the detector; others are not asked about meanwhile.
class DetectionStage {
 public:
  DetectionStage(std::shared_ptr<Detector> detector, const DetectionOptions& options, const Camera& camera,
                 Executor* executor);

  // To be called first for each frame: takes an answer that came late. Whether the detector should be asked
  // about this frame.
  bool Begin(FrameId frame, double timestamp_s);

  // Asks about the image (as Detector takes it), which must not change until Begin() is true again if the
  // detector reads its pixels.
  void Submit(FrameId frame, double timestamp_s, const cv::Mat& image);

  // The boxes of the frame, whether it was asked about or not. cam_from_last, motions: as far as known
  // (CompensationInput).
  FrameObjects Collect(FrameId frame, double timestamp_s,
                       const std::optional<Eigen::Quaterniond>& cam_from_last,
                       std::span<const PointMotion> motions = {});

  // How the camera turned after all.
  void SetRotation(FrameId frame, const Eigen::Quaterniond& cam_from_last);

  void Reset();

  const Detector& detector() const { return *detector_; }
  DetectionReport report() const;

 private:
  struct Question {
    FrameId frame;
    double asked_s;
    double answer_due_s;  // not used before this stamp: a simulated slow network
  };
  // What the task in the detector's lane writes; it may outlive the stage.
  struct Shared {
    DetectionExchange exchange;
    Guarded<std::vector<double>> times_ms;
  };

  // The answer to the open question, if it is due and there by the deadline; a failure is noted and no
  // answer.
  std::optional<DetectionResult> TakeAnswer(double timestamp_s, double patience_ms);

  // FrameObjects::untold_from, of a frame with this stamp.
  FrameId UntoldFrom(double timestamp_s) const;

  // The objects that the answer about `told` brought, in that frame and those since but the last.
  std::vector<LateObjects> NewlyTold(FrameId told) const;

  std::shared_ptr<Detector> detector_;
  DetectionOptions options_;
  Executor* executor_;
  std::unique_ptr<BoxCompensation> compensation_;
  DynamicScore score_;
  std::shared_ptr<Shared> shared_;
  std::optional<Question> open_;
  std::optional<DetectionResult> answer_;  // that came before it was due
  std::string failure_;                    // of an answer taken in this frame
  FrameId told_to_;                        // of the last answer
  FrameId told_late_;                      // of the answer taken in this frame, when it came late
  DetectionReport report_;
};

}  // namespace dynamic_slam
