#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/features/features.h"
#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// The landmarks that tracking may see next, copied out of the map so that it can work without looking at the
// map: a structure of arrays, entry i of each belongs to one landmark.
struct LocalView {
  // Entries of the landmarks in view, in the order in which they are looked for; of others there are entries
  // too.
  std::vector<uint32_t> near;
  std::vector<LandmarkId> ids;
  std::vector<Eigen::Vector3d> positions;  // in world
  std::vector<Eigen::Vector3f> normals, spreads;
  std::vector<float> min_distances, max_distances;
  std::vector<Descriptor> descriptors;
  std::vector<float> static_log_odds;
  KeyframeId reference;         // the keyframe that shares most landmarks with the frame
  Rigid3 reference_from_world;  // where it was when the view was made: the map goes on changing
  double reference_unit = 1;    // Keyframe::unit
  uint32_t revision = 0;        // of the map

  size_t size() const { return near.size(); }
};

// Finds the keyframes that see the given landmarks, adds their best neighbours up to max_keyframes, and
// copies what they all see. Entries that are not valid or gone are passed over. Keeps the buffers of *view,
// which is the same in each call; what was copied of a map that has not changed since is not copied again.
class LocalViewBuilder {
 public:
  // writes: Guarded::ReadHandle::Writes of the map.
  void Build(const Map& map, uint64_t writes, const std::vector<LandmarkId>& seen, int max_keyframes,
             LocalView* view);

  // The landmarks given, and no keyframe. Copied anew, so that the copies may be changed.
  void Copy(const Map& map, const std::vector<LandmarkId>& landmarks, LocalView* view);

 private:
  void CountVotes(const Map& map, const std::vector<LandmarkId>& seen);
  void ChooseKeyframes(const Map& map, size_t limit, LocalView* view);
  void CollectLandmarks(const Map& map);
  void CopyLandmarks(const Map& map, LocalView* view);
  void ForgetCopies(LocalView* view);

  // Where the view has the copy of a landmark. Of two whose ids share a slot the later has it, and the other
  // is copied anew: a table of all ids would grow for as long as the map is worked on.
  struct Slot {
    LandmarkId id;
    uint32_t entry = 0;
  };
  static constexpr uint32_t kSlots = 1 << 15;

  std::optional<uint64_t> writes_;  // to the map, when the copies were made
  std::vector<Slot> slots_;         // by landmark id modulo kSlots
  // The landmarks that the view holds already: a bit for each that ever was, all 0 between builds.
  std::vector<uint64_t> is_taken_;
  std::vector<LandmarkId> fresh_;        // of one keyframe
  std::vector<LandmarkId> landmarks_;    // of all
  std::vector<const Landmark*> copied_;  // in this build
  std::vector<int> votes_;               // by keyframe id
  std::vector<KeyframeId> keyframes_;
  std::vector<CovisibleKeyframe> neighbours_;
};

}  // namespace dynamic_slam
