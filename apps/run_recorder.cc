#include "run_recorder.h"

#include <utility>

#include "dynamic_slam/base/error.h"
#include "movers.h"

namespace dynamic_slam {
namespace {

constexpr int kFrames = 8;  // in a report

// A stream is no folder, however long its address is.
bool HasTrueBoxes(const std::filesystem::path& sequence) {
  std::error_code ignored;
  return std::filesystem::exists(TrueBoxes(sequence), ignored);
}

}  // namespace

RunRecorder::RunRecorder(std::filesystem::path source, const Camera& raw_camera, const ImageOptions& options)
    : source_(std::move(source)),
      has_true_boxes_(HasTrueBoxes(source_)),
      preparer_(raw_camera, options),
      frames_(raw_camera, options, kFrames) {}

std::shared_ptr<Detector> RunRecorder::Record(std::shared_ptr<Detector> detector) {
  if (detector == nullptr || !has_true_boxes_) return detector;
  detector_ = std::make_shared<RecordingDetector>(std::move(detector));
  return detector_;
}

void RunRecorder::Watch(const RunProgress& progress) {
  frames_.Watch(progress);
  if (!has_true_boxes_) return;
  for (const DynamicBox& box : progress.result->objects.boxes) {
    compensated_.push_back({progress.image->timestamp_s,
                            progress.detector->class_names()[static_cast<size_t>(box.class_id)], box.score, 1,
                            box.box});
  }
}

RunRecord RunRecorder::Finish(const RunSummary& summary, std::optional<Trajectory> truth) {
  RunRecord record{.truth = std::move(truth), .frames = frames_.Frames()};
  if (detector_ == nullptr) return record;
  std::vector<double> stamps_s;
  for (const RunSummary::FrameRecord& frame : summary.frames) stamps_s.push_back(frame.timestamp_s);
  record.detected = MoversOf(detector_->records());
  record.compensated = MoversOf(std::move(compensated_));
  record.true_boxes = TrueMovers(source_, stamps_s, preparer_);
  return record;
}

void WriteRunReport(const std::filesystem::path& folder, const std::string& title, const SlamSystem& system,
                    const RunSummary& summary, const RunRecord& record) {
  WritePage(folder / "report.html", MakeRunPage(title, system, summary, record));
}

}  // namespace dynamic_slam
