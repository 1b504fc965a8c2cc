#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "dynamic_slam/report/recording_detector.h"
#include "dynamic_slam/report/run_report.h"

namespace dynamic_slam {

// Watches a run and writes its report.
class RunRecorder {
 public:
  // source: boxes.csv in that folder are the true boxes.
  RunRecorder(std::filesystem::path source, const Camera& raw_camera, const ImageOptions& options);

  // The same detector, whose answers are kept where there are true boxes; null for null.
  std::shared_ptr<Detector> Record(std::shared_ptr<Detector> detector);

  // To be called after each frame.
  void Watch(const RunProgress& progress);

  // To be called when the run has ended, once.
  RunRecord Finish(const RunSummary& summary, std::optional<Trajectory> truth);

 private:
  std::filesystem::path source_;
  bool has_true_boxes_;  // else boxes are compared with nothing, and none are kept: a run may last for hours
  ImagePreparer preparer_;
  FrameChoice frames_;
  std::shared_ptr<RecordingDetector> detector_;
  std::vector<BoxRecord> compensated_;
};

// report.html in the folder of a run's results. Throws InputError.
void WriteRunReport(const std::filesystem::path& folder, const std::string& title, const SlamSystem& system,
                    const RunSummary& summary, const RunRecord& record);

}  // namespace dynamic_slam
