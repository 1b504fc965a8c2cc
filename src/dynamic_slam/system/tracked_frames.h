#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/file_backed_vector.h"
#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/shared_map.h"

namespace dynamic_slam {

// The frames of a run that have a pose: each hangs on a keyframe, and is where the map puts that. They lie in
// a file, as there is one for each image.
class TrackedFrames {
 public:
  // Frames of a part of the map that may stand wrong in it.
  struct Piece {
    PartId part;
    std::map<double, Eigen::Vector3d> centres;  // of the camera, by stamp
    double longest_step = 0;                    // of the rest of the part (LongestStep)
    bool is_end = false;                        // of what lies on one side of a leap, else all of it
  };

  explicit TrackedFrames(SharedMap* map) : map_(map) {}

  // A frame later than all others. is_live: not given its pose by a later frame.
  void Add(const AnchoredPose& pose, bool is_live) { frames_.push_back(TrackedFrame(pose, is_live)); }
  void RemoveLast() { frames_.pop_back(); }
  void Remove(const std::set<double>& stamps);
  void RemoveThoseOfErasedParts();
  // Frames of the piece that are not among these.
  void RemoveAllBut(std::span<const AnchoredPose> found, const Piece& piece);
  // In any order: frames that had none, or one that is given up.
  void AddFound(std::span<const AnchoredPose> poses);
  // Poses of frames that have one, in any order, instead.
  void Replace(std::span<const AnchoredPose> poses);
  // Frames that hang on the part of the map in which they are views, to where these are.
  void Move(std::span<const FrameView> views);
  void Clear() { frames_.clear(); }

  bool Leaps() const;

  // Where the path of a part leaps, which the camera cannot have done, either that part does not fit together
  // or the film has a cut. If nearly all of it is on one side of every leap: what is on the other.
  std::vector<Piece> PiecesAtLeaps() const;

  // The frames no longer than that before the end of every leap, or after its beginning: tracking goes astray
  // before it is lost, and may have begun so.
  std::vector<Piece> EndsAtLeaps(double within_s, bool is_before) const;

  // Keyframes of the pieces become parts of their own, one for each piece that has some, and its frames hang
  // on these; all others hang on the rest. Returns those parts.
  std::vector<PartId> CutOff(std::span<const Piece> pieces);

  // Whether none of the piece's frames had a pose when its turn came, and none became a keyframe.
  bool IsGuessed(const Piece& piece) const;

  // Whether the piece, cut off, stood wrong in its part, by the poses that were found in the rest. A whole
  // side of a leap: of a quarter of its frames or more, and most of these are farther away than the camera
  // moves from one frame to the next. An end: of nearly all, and with them the path leaps there no more.
  bool IsWrong(const Piece& piece, std::span<const AnchoredPose> found) const;

  // Whether nearly all frames of these stamps were found in the part.
  bool HasNearlyAll(PartId part, const std::set<double>& stamps, std::span<const AnchoredPose> found) const;

  // The path of each part becomes what is most probable (SmoothPath). `should_stop` may be empty.
  void Smooth(const std::function<bool()>& should_stop);

  std::vector<AnchoredPose> Poses() const;
  std::vector<AnchoredPose> PosesBut(const std::set<double>& stamps) const;
  // The parts that have frames: the one with the most first.
  std::vector<PartId> Parts() const;
  Trajectory PathOf(PartId part) const;
  Trajectory SmoothPathOf(PartId part) const;  // what Smooth would make of it
  Trajectory LivePathOf(PartId part) const;    // of those that had their pose when their turn came
  size_t LiveCountOf(PartId part) const;

 private:
  // An AnchoredPose in half the room: float has it to 1e-7 of its length.
  struct TrackedFrame {
    double timestamp_s = 0;
    KeyframeId reference;
    bool is_live = false;
    std::array<float, 4> rotation_xyzw{};
    std::array<float, 3> translation{};

    TrackedFrame(const AnchoredPose& pose, bool is_live_in);
    AnchoredPose Pose() const;
  };

  Trajectory PathOf(PartId part, bool only_live) const;
  PartId CutOff(const Piece& piece);
  bool IsElsewhere(const Piece& piece, const Trajectory& found) const;
  bool IsMended(const Piece& piece, const Trajectory& found) const;

  std::vector<TrackedFrame> All() const { return {frames_.begin(), frames_.end()}; }

  SharedMap* map_;
  FileBackedVector<TrackedFrame> frames_;  // in the order of time
};

}  // namespace dynamic_slam
