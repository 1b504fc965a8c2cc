#pragma once

#include <string>
#include <vector>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/features/place_index.h"
#include "dynamic_slam/geometry/sim3.h"
#include "dynamic_slam/map/id_table.h"
#include "dynamic_slam/map/keyframe.h"
#include "dynamic_slam/map/landmark.h"
#include "dynamic_slam/map/merge_log.h"

namespace dynamic_slam {

// Keyframes, landmarks and who sees what: the one object that the stages share.
//
// Where tracking was lost and started anew, the map has several parts. Each has an origin and a unit of
// length of its own, and no landmark in common with another, until a place is known again and they become
// one.
//
// Each link between a keypoint and a landmark is kept on both sides, and each pair of keyframes knows how
// many landmarks it shares; both hold after every call.
class Map {
 public:
  // octave_scales: size of a pixel of each octave in full-resolution px (OctaveScales of features).
  explicit Map(std::vector<float> octave_scales) : octave_scales_(std::move(octave_scales)) {}

  // Empties the map. Ids start again from 0, so that those of before mean nothing any more: whoever keeps ids
  // while the map is unlocked compares the epoch, which changes with ErasePart too.
  void Reset();
  // Becomes another map, as after Reset, or itself again as it was before a trial.
  void Replace(Map other);
  uint32_t epoch() const { return epoch_; }

  // Counts up when poses and points change all at once, for a loop or in the adjustment of everything: what
  // was computed from the map before does not fit it any more.
  uint32_t revision() const { return revision_; }
  void BeginRevision() { ++revision_; }

  Keyframe& AddKeyframe(FrameId frame, double timestamp_s, const Rigid3& cam_from_world, FeatureSet features,
                        KeypointGrid grid, std::vector<float> static_probability = {},
                        PartId part = PartId(0));

  // A new part, which the next keyframe that is added to it is the origin of.
  PartId BeginPart();

  // Parts with keyframes, in the order of their oldest ones.
  std::vector<PartId> Parts() const;
  int KeyframesIn(PartId part) const;

  // Whether the keyframe is the oldest of its part: nothing moves it but MergePart.
  bool IsOrigin(KeyframeId id) const;

  // Frames that hang on keyframes of the part have no pose any more.
  void ErasePart(PartId part);

  // The part `from` becomes a piece of `into`, moved and scaled.
  void MergePart(PartId from, PartId into, const Sim3& into_from_from);

  // Keyframes of one part, not all of them, become a part of their own. Landmarks that both see stay with
  // those of whom more see them.
  PartId SplitPart(const std::vector<KeyframeId>& keyframes);

  Landmark& AddLandmark(const Eigen::Vector3d& position, KeyframeId created_by) {
    return landmarks_.Emplace(position, created_by);
  }

  // The keypoint must be free, and the keyframe must not see the landmark already.
  void Link(KeyframeId keyframe, uint32_t keypoint, LandmarkId landmark);

  // For a map that is put together at once: all links of a landmark that has none yet, in order of their
  // keyframes. CountCovisibility() follows the last of them, before anything else is asked of the map.
  void LinkAll(LandmarkId landmark, std::vector<Observation> observations);
  void CountCovisibility();

  // Removes the keypoint's link, and the landmark with it when fewer than two observations are left.
  void Unlink(KeyframeId keyframe, uint32_t keypoint);

  void EraseLandmark(LandmarkId id);

  // Frames that hang on the keyframe hang on `heir` from now on, at the pose they have now.
  void EraseKeyframe(KeyframeId id, KeyframeId heir);

  // The landmark `from` is the same point as `into`: moves its observations and erases it.
  void MergeLandmarks(LandmarkId from, LandmarkId into);

  // What became of a landmark: itself, the one it was merged into, or not valid when it is gone. For those
  // who knew it a while ago: merges of long ago are forgotten (MergeLog).
  LandmarkId Resolve(LandmarkId id) const;

  // Recomputes normal, distances and descriptor from the observations.
  void RefreshLandmark(LandmarkId id);

  // The keyframe a frame hangs on now, not valid when its part is gone, and the pose of the one it was made
  // with in it, each in units of its own.
  struct Anchor {
    KeyframeId keyframe;
    Sim3 original_from_keyframe;
  };
  Anchor ResolveKeyframe(KeyframeId id) const;

  // Pose of a frame that was tracked relative to `reference`, after all that has happened to the map since;
  // its part must not be gone. cam_from_reference: in units of the reference (Keyframe::unit).
  Rigid3 PoseFromReference(KeyframeId reference, const Rigid3& cam_from_reference) const;

  // The other way round: what hangs a frame on `reference` so that its pose is this one.
  Rigid3 CamFromReference(KeyframeId reference, const Rigid3& cam_from_world) const;

  // The part of the map in which such a frame is; not valid when it is gone.
  PartId PartOf(KeyframeId reference) const;

  PartId PartOf(const Landmark& landmark) const {
    return keyframes_.At(landmark.observations().front().keyframe).part();
  }

  // The unit of a keyframe, and of the keyframe's heir for one that is gone.
  double UnitOf(KeyframeId reference) const;

  const IdTable<KeyframeId, Keyframe>& keyframes() const { return keyframes_; }
  IdTable<KeyframeId, Keyframe>& keyframes() { return keyframes_; }
  const IdTable<LandmarkId, Landmark>& landmarks() const { return landmarks_; }
  IdTable<LandmarkId, Landmark>& landmarks() { return landmarks_; }
  const std::vector<float>& octave_scales() const { return octave_scales_; }

  // What the keyframes look like; what can move takes no part.
  const PlaceIndex& places() const { return places_; }

  // Median depth of the keyframe's landmarks in its camera; 0 when there are none.
  double MedianDepth(KeyframeId id) const;

  // Everything that is wrong with the map, recomputed from scratch; empty when nothing is.
  std::vector<std::string> Validate() const;

 private:
  KeyframeId OldestOf(PartId part) const;

  std::vector<float> octave_scales_;
  uint32_t epoch_ = 0, revision_ = 0;
  IdTable<KeyframeId, Keyframe> keyframes_;
  IdTable<LandmarkId, Landmark> landmarks_;
  PlaceIndex places_;
  std::vector<KeyframeId> origins_{KeyframeId()};  // by part
  MergeLog merges_;
  std::vector<Anchor> heirs_;  // by keyframe id; not valid while the keyframe lives
};

}  // namespace dynamic_slam
