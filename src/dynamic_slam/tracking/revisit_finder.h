#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "dynamic_slam/map/landmark_projector.h"
#include "dynamic_slam/map/local_view.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/tracking/keypoint_links.h"
#include "dynamic_slam/tracking/pose_tracker.h"

namespace dynamic_slam {

// Links keyframes to what the map has of the same things from another time. A camera that comes by again,
// some centimetres off by the error that has grown meanwhile, or that looks from another side, does not find
// what the map knows, and makes new landmarks beside the old ones. In the finished map it is known, to some
// pixels, where each keyframe should see the old ones: there they are looked for. Those that fit one pose of
// the keyframe are linked, where many do, or where a keyframe beside it tells the same of how the two visits
// lie to each other. Holds the map's lock for one keyframe at a time, and moves nothing: who links adjusts
// the map.
class RevisitFinder {
 public:
  RevisitFinder(const Camera& camera, const TrackerOptions& options, SharedMap* map);

  // Returns how many keypoints show landmarks of another time now.
  int LinkAll(const std::function<bool()>& should_stop);

 private:
  // Where a keyframe is, and how far it looks.
  struct Viewpoint {
    KeyframeId id;
    PartId part;
    double timestamp_s = 0;
    Eigen::Vector3d center;  // in world
    double depth = 0;        // median of its landmarks
    bool is_of_this_run = true;
  };

  // A pose of a keyframe by the landmarks of another time.
  struct Revisit {
    KeyframeId keyframe;
    Rigid3 cam_from_world;
    double inliers = 0;  // that can be right
    KeypointLinks links;
  };

  // What a keyframe should see of the landmarks of each other one, by its id, and what it does see.
  struct Overlap {
    std::vector<int> visible, seen;
    std::vector<LandmarkId> unseen;  // those that it should see
    bool IsKnown(KeyframeId other) const;
  };

  void FindViewpoints();
  std::vector<Revisit> RevisitsOf(const Viewpoint& viewpoint);
  Overlap OverlapOf(const Map& map, const Viewpoint& viewpoint);
  // By id: whether the keyframe is of the same time as the viewpoint, from which the camera has not been
  // away.
  std::vector<uint8_t> OfSameTime(const Map& map, const Viewpoint& viewpoint, const Overlap& overlap) const;
  // Those that the keyframes of a visit, by id, show of what is not seen.
  static std::vector<LandmarkId> OfVisit(const Map& map, const Overlap& overlap,
                                         const std::vector<uint8_t>& is_of_visit);
  std::optional<Revisit> Locate(const Map& map, const Keyframe& keyframe,
                                const std::vector<LandmarkId>& landmarks);
  bool IsConfirmed(const Map& map, const Revisit& revisit) const;
  int Link(const Revisit& revisit);

  Camera camera_;
  TrackerOptions options_;
  SharedMap* map_;
  LandmarkProjector projector_;
  PoseTracker pose_tracker_;
  LocalViewBuilder view_builder_;
  LocalView view_;
  std::vector<uint8_t> in_view_;
  std::vector<Viewpoint> viewpoints_;           // in the order of time
  std::vector<std::vector<Revisit>> revisits_;  // by keyframe id
};

}  // namespace dynamic_slam
