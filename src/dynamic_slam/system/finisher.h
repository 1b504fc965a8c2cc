#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/mapping/bundle_terms.h"
#include "dynamic_slam/mapping/map_calibration.h"
#include "dynamic_slam/system/back_end.h"
#include "dynamic_slam/system/run_mode.h"
#include "dynamic_slam/system/system_options.h"
#include "dynamic_slam/system/tracked_frames.h"
#include "dynamic_slam/tracking/backfiller.h"
#include "dynamic_slam/tracking/bridge_finder.h"
#include "dynamic_slam/tracking/pose_refiner.h"
#include "dynamic_slam/tracking/sighting_aligner.h"
#include "dynamic_slam/tracking/tracker.h"

namespace dynamic_slam {

// What is done with map and path when the sequence is over. Offline it remembers the frames for that.
class Finisher {
 public:
  // All must outlive it.
  Finisher(const Camera& camera, const SystemOptions& options, RunMode mode, SharedMap* map,
           BackEnd* back_end, TrackedFrames* tracked);

  // A frame that tracking has done. grey: the image in which its keypoints are.
  void Remember(const Frame& frame, const TrackingResult& tracking, const cv::Mat& grey);

  // To be called when the back end is drained: adjusts the whole map and, offline, finds poses of frames that
  // have none yet, joins parts of which one goes on where another ends, grows over parts that nothing joined,
  // or joins them by what they show alike, tracks all frames once more, cuts off what stands wrong, and
  // smooths the path. Where the map grows, that is done twice (ADR 0010). `should_stop` may be empty; when it
  // says so, what is there by then stays.
  BundleSummary Finish(const std::function<bool()>& should_stop);

  // See SlamSystem.
  int pieces_cut() const { return pieces_cut_; }
  size_t frames_refuted() const { return frames_refuted_; }
  const std::optional<SelfCalibration>& lens_doubt() const { return lens_doubt_; }

  void Clear();

 private:
  // To come back to.
  struct State {
    Map map;
    TrackedFrames tracked;
    std::set<double> backfilled;  // stamps of the frames that the backfiller keeps
    BackEndReports reports;
    int pieces_cut;
    size_t frames_refuted;
  };
  State Save() const;
  void Restore(State state);

  bool ChangesMap() const { return !options_.tracker.localise_only; }
  bool MayGrow() const { return backfiller_.has_value() && options_.backfill_grows_map && ChangesMap(); }
  // Whether sightings may be aligned: not where the map asks for another lens, as that would make more of the
  // wrong one.
  bool MayAlign(const std::function<bool()>& should_stop);
  bool AdjustsMap() const { return options_.final_bundle && ChangesMap(); }
  bool Smooths() const { return options_.smooth_path && mode_ == RunMode::kOffline; }
  Trajectory MainPath() const;
  // Of a rolling shutter's camera, as the smoothed paths have them.
  SightingAligner::Motions Motions() const;

  // Finds poses of frames that have none, and makes one of parts of the map that fit together. grows: by a
  // plan that the backfiller has.
  BundleSummary Complete(bool grows, const std::function<bool()>& should_stop);
  // Adjusts the map and the path to each other. aligned: to where the images show landmarks, else to where
  // keypoints are.
  void Refine(bool aligned, const std::function<bool()>& should_stop);
  // Lets the map grow by frames that have no pose, as planned. Returns all poses that were found.
  std::vector<AnchoredPose> Grow(std::span<const AnchoredPose> known,
                                 const std::function<bool()>& should_stop);
  // Makes one of parts of the map where frames of one follow those of another, and mends a part that has such
  // a border in itself.
  void CloseBorders(const std::function<bool()>& should_stop);
  // Where the main part can grow over nearly all frames of another one that nothing joined, that is given up.
  // Where it reaches some of them, the images that both have join the two.
  void GrowOverParts(const std::function<bool()>& should_stop);
  // Lets the map grow from all other frames over those of these stamps. Returns all poses that were found.
  std::vector<AnchoredPose> GrowOver(const std::set<double>& stamps,
                                     const std::function<bool()>& should_stop);
  // By keyframes of these stamps with which the map has just grown; whether one of them did.
  bool JoinBySharedFrames(const std::set<double>& stamps, const std::function<bool()>& should_stop);
  // Makes one of the main part and others in which keyframes show what it shows.
  void JoinAlikeParts(const std::function<bool()>& should_stop);
  // Links keyframes to what the map has of the same things from another time, and adjusts it. bundle: gets
  // what the last adjustment did, if there was one.
  void LinkRevisits(const std::function<bool()>& should_stop, BundleSummary* bundle);
  // Adjusts the map to what frames see that are tracked once more in it. noises: gets how the camera was
  // moved, where that is known.
  void RefineMap(bool aligned, const std::function<bool()>& should_stop, MotionNoises* noises);
  // Tracks frames once more in the finished map. Poses that it refutes are given up; the path of the others
  // becomes what is most probable.
  void RefinePath(bool aligned, const MotionNoises& noises, const std::function<bool()>& should_stop);

  const Camera& camera_;
  const SystemOptions& options_;
  RunMode mode_;
  SharedMap* map_;
  BackEnd* back_end_;
  TrackedFrames* tracked_;
  BridgeFinder bridge_finder_;
  std::optional<Backfiller> backfiller_;    // offline, unless it is turned off
  std::optional<PoseRefiner> refiner_;      // offline, unless it is turned off
  std::optional<SightingAligner> aligner_;  // where there is a refiner, unless it is turned off
  int pieces_cut_ = 0;
  size_t frames_refuted_ = 0;
  std::optional<SelfCalibration> lens_doubt_;
};

}  // namespace dynamic_slam
