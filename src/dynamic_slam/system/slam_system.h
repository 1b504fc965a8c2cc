#pragma once

#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/io/image_preparer.h"
#include "dynamic_slam/map/map_file.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/system/back_end.h"
#include "dynamic_slam/system/detection_stage.h"
#include "dynamic_slam/system/executor.h"
#include "dynamic_slam/system/finisher.h"
#include "dynamic_slam/system/run_mode.h"
#include "dynamic_slam/system/system_options.h"
#include "dynamic_slam/system/tracked_frames.h"
#include "dynamic_slam/tracking/tracker.h"

namespace dynamic_slam {

// What became of one image, and how long it took.
struct FrameResult {
  FrameId id;
  TrackingResult tracking;
  FrameObjects objects;
  double tracking_ms = 0;     // from the image in memory to its pose
  int keyframes_waiting = 0;  // for local mapping, when the frame was done
};

// Dynamic-SLAM. All calls come from one thread; in realtime mode the stages beside tracking have their own.
//
// What a stage throws, tracking or another, reaches the caller by this call or the next of Process or Finish,
// and by those after it again. After that, and after Stop(), the results so far can be read; Reset() makes
// the system as new.
class SlamSystem {
 public:
  // raw_camera: of the images that Process takes. Throws InputError when it or an option is out of range.
  SlamSystem(const Camera& raw_camera, const SystemOptions& options, RunMode mode = RunMode::kOffline);
  // The stages beside tracking run where the executor puts them.
  SlamSystem(const Camera& raw_camera, const SystemOptions& options, RunMode mode,
             std::unique_ptr<Executor> executor);
  ~SlamSystem();

  // Tracking is told of the objects that this detector sees, from the next image on; null: of none. To be
  // called before the first image.
  void SetDetector(std::shared_ptr<Detector> detector);

  // The camera is looked for in this map first. To be called before the first image. Throws as CheckMapFits
  // does for the file `name`.
  void LoadMap(SavedMap saved, const std::string& name);

  // Only poses in the map, which stays as it is (true), or growth again (false), from the next image on.
  // Waits for what mapping has begun. Throws InputError when there is no map to localise in.
  void SetLocaliseOnly(bool localise_only);

  // image: of the raw camera's size, any type that ImagePreparer takes. mask: empty, or CV_8UC1 of camera()'s
  // size, not 0 where keypoints are forbidden, beside those of the static mask. Throws InputError, and
  // changes nothing, when the image cannot be prepared.
  FrameResult Process(double timestamp_s, const cv::Mat& image, const cv::Mat& mask = {});

  // To be called after the last image: waits for the stages, then finishes map and path (Finisher). Poses and
  // landmarks are final after it. `should_stop` may be empty; when it says so, that ends with what it has.
  // Does nothing after Stop().
  BundleSummary Finish(const std::function<bool()>& should_stop = {});

  // Drops what the stages have not begun and ends what they have: soon, but the map stays valid. No more
  // images after that.
  void Stop();

  // Forgets all images and the map.
  void Reset();

  // Parts of the map with frames, each with a world and a unit of length of its own: the one with the most
  // frames first. More than one where tracking was lost, started anew, and saw nothing since that it knew
  // before.
  std::vector<PartId> Parts() const { return tracked_.Parts(); }

  // The frames that have a pose in the part, the main one unless it is said, at where the map puts them now.
  Trajectory FrameTrajectory(PartId part = {}) const;
  Trajectory KeyframeTrajectory(PartId part = {}) const;  // without those of a map that was loaded

  // Those frames of the main part that had their pose when their turn came.
  Trajectory LiveTrajectory() const { return tracked_.LivePathOf(OrMain({})); }
  size_t LiveFrameCount() const { return tracked_.LiveCountOf(OrMain({})); }

  // Pieces of the path that stood wrong in the map: since Finish() their frames have their poses in the rest
  // of it, or are in parts of their own.
  int PiecesCut() const { return finisher_.pieces_cut(); }

  // Frames whose pose the finished map did not confirm, and where the camera cannot have come by those that
  // it did: they have none any more.
  size_t FramesRefuted() const { return finisher_.frames_refuted(); }

  // The lens that the finished map asks for, where it fits the images notably better than that of the camera:
  // then sightings were not aligned, and `dynamic_slam doctor` is to be asked.
  const std::optional<SelfCalibration>& LensDoubt() const { return finisher_.lens_doubt(); }

  // None without a detector.
  std::optional<DetectionReport> detection_report() const {
    return detection_.has_value() ? std::optional(detection_->report()) : std::nullopt;
  }
  const Detector* detector() const { return detection_.has_value() ? &detection_->detector() : nullptr; }
  MappingReport mapping_report() const { return back_end_.mapping_report(); }
  LoopReport loop_report() const { return back_end_.loop_report(); }
  RunMode mode() const { return mode_; }
  const Frame& frame() const { return tracker_.frame(); }  // of the last Process
  const SharedMap& map() const { return map_; }
  const ImagePreparer& preparer() const { return preparer_; }
  const Camera& camera() const { return preparer_.camera(); }  // of the prepared images
  const SystemOptions& options() const { return options_; }

 private:
  PartId OrMain(PartId part) const;
  FrameResult ProcessPrepared(double timestamp_s, const cv::Mat& image, const cv::Mat& mask,
                              std::chrono::steady_clock::time_point start);
  void ThrowIfFailed() const;
  void Remember(const FrameResult& result);

  SystemOptions options_;
  ImagePreparer preparer_;
  RunMode mode_;
  SharedMap map_;
  Tracker tracker_;
  BackEnd back_end_;
  std::optional<DetectionStage> detection_;
  TrackedFrames tracked_;
  Finisher finisher_;
  uint32_t frame_count_ = 0;
  cv::Mat grey_;                // the image in work
  cv::Mat colour_;              // that of the last question to the detector; free once that is answered
  std::exception_ptr failure_;  // of Process: what it left half done is not gone on with
  bool is_stopped_ = false;
  std::unique_ptr<Executor> executor_;  // last: its tasks use all the others
};

}  // namespace dynamic_slam
