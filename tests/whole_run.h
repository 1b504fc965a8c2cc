#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamic_slam/eval/metrics.h"
#include "dynamic_slam/sim/room.h"
#include "dynamic_slam/system/sequence_runner.h"
#include "dynamic_slam/system/slam_system.h"

namespace dynamic_slam {

// Runs of the whole SLAM, for tests.

// Images in memory, 1/30 s apart.
class ImageSource : public FrameSource {
 public:
  explicit ImageSource(std::vector<cv::Mat> images) : images_(std::move(images)) {}

  std::optional<SourceImage> Next() override {
    if (next_ == images_.size()) return std::nullopt;
    const size_t i = next_++;
    return SourceImage{static_cast<double>(i) / 30, images_[i], std::to_string(i)};
  }
  size_t FrameCount() const override { return images_.size(); }
  std::string Layout() const override { return "images"; }
  std::optional<Camera> OwnCamera() const override { return std::nullopt; }
  cv::Size ImageSize() const override { return images_.front().size(); }
  const std::vector<SourceProblem>& Problems() const override { return problems_; }

 private:
  std::vector<cv::Mat> images_;
  size_t next_ = 0;
  std::vector<SourceProblem> problems_;
};

struct WholeRun {
  std::unique_ptr<SlamSystem> system;
  RunSummary summary;
};

inline WholeRun RunAll(FrameSource& source, const Camera& camera, const SystemOptions& options = {}) {
  WholeRun run;
  run.system = std::make_unique<SlamSystem>(camera, options);
  run.summary = RunSequence(source, *run.system);
  return run;
}

inline WholeRun RunImages(std::vector<cv::Mat> images, const SystemOptions& options = {}) {
  ImageSource source(std::move(images));
  return RunAll(source, DefaultRoomCamera(), options);
}

// Rooted mean square of the absolute position errors after sim(3) alignment, m.
inline double ApeRmse(const Trajectory& truth, const Trajectory& estimate) {
  return AbsolutePoseError(MatchByTime(ToPoseList(truth), ToPoseList(estimate), 0.01), Alignment::kSim3)
      .translation_m.rmse;
}

}  // namespace dynamic_slam
