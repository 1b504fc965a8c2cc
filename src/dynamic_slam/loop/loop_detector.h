#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/loop/loop_options.h"
#include "dynamic_slam/map/landmark_projector.h"
#include "dynamic_slam/map/shared_map.h"

namespace dynamic_slam {

// A place that looked like a keyframe's, and how far the look was confirmed.
struct LoopAttempt {
  KeyframeId keyframe, candidate;
  double timestamp_s = 0;  // of the keyframe
  double candidate_timestamp_s = 0;
  double score = 0;      // of PlaceIndex
  int matches = 0;       // of landmarks, by their descriptors; at a border, landmarks on both sides
  int sim3_inliers = 0;  // of these
  int visible = 0;       // landmarks of the old place that the keyframe should see
  int inliers = 0;       // of these: show where the similarity puts them
  int confirming = 0;    // neighbours of the keyframe that see them too
  double scale = 1;      // length about the keyframe over the same length about the candidate
  double drift_px = 0;   // from where the map has the old landmarks to where they are, median
  std::string reason;    // why it was refused; empty when it was not
};

// A keyframe that sees what was seen before, though the map does not know it.
struct Loop {
  struct Link {
    uint32_t keypoint;  // of the keyframe
    LandmarkId landmark;
  };

  KeyframeId keyframe, candidate;
  Sim3 keyframe_from_candidate;       // cameras, each in the map's unit of length about it
  std::vector<Link> links;            // what the keyframe sees of the old place
  std::vector<LandmarkId> landmarks;  // of the old place
  bool has_drifted = true;            // else the map is right, and lacks the links only
};

// Cameras, in the map's units about them, which are one within a part.
Sim3 FromKeyframe(const Keyframe& other, const Keyframe& keyframe);

// Whether the map is to be moved; parts always are.
bool HasDrifted(const Keyframe& keyframe, const Keyframe& candidate, double drift_px,
                const LoopOptions& options);

// The landmarks about a keyframe that make a place.
std::vector<LandmarkId> LandmarksOfPlace(const Map& map, const Keyframe& keyframe);

// Looks for loops: places that look alike, matches, a similarity, matches by projection, a look by the
// neighbours. Holds the map's lock for moments; changes nothing.
class LoopDetector {
 public:
  LoopDetector(const Camera& camera, const LoopOptions& options, const std::vector<float>& octave_scales,
               uint64_t seed);

  // The first candidate that passes is the loop; what became of each one tried goes to the end of *attempts.
  // Nothing when the map is not of the epoch any more.
  std::optional<Loop> Detect(KeyframeId keyframe, uint32_t epoch, const SharedMap& map,
                             std::vector<LoopAttempt>* attempts);

  // The same between two parts of the map, by what many of their keyframes together show that looks alike
  // (PartMatches). What became of it is the last of *attempts: of those that failed, the one that came the
  // farthest. Holds the map's lock until it is done. `should_stop` may be empty.
  std::optional<Loop> DetectAcross(PartId here, PartId there, const SharedMap& map,
                                   const std::function<bool()>& should_stop,
                                   std::vector<LoopAttempt>* attempts);

 private:
  struct Candidate {
    LoopAttempt attempt;
    std::vector<Sim3Match> matches;
  };

  std::string TooFewFit(int inliers) const;
  std::vector<Candidate> Candidates(const Map& map, const Keyframe& keyframe) const;
  std::vector<Sim3Match> MatchLandmarks(const Map& map, const Keyframe& keyframe,
                                        const Keyframe& candidate) const;
  void AddMatch(const Map& map, const Keyframe& keyframe, const Keyframe& candidate, uint32_t keypoint_index,
                LandmarkId landmark, std::vector<Sim3Match>* matches) const;
  // Of the landmarks of the old place.
  struct Needed {
    int inliers;
    double found_share;
  };
  // Fills in the attempt; its reason is empty when it is a loop.
  Loop Verify(const Map& map, const Keyframe& keyframe, const Keyframe& candidate, const Sim3& similarity,
              const Needed& needed, LoopAttempt* attempt);
  // What the keyframe sees of the landmarks from where it would be among them. *visible: how many of them it
  // should see.
  std::vector<Loop::Link> FindLandmarks(const Map& map, const Keyframe& keyframe,
                                        const Rigid3& cam_from_world,
                                        const std::vector<LandmarkId>& landmarks, double radius_px,
                                        int* visible);
  // What neighbours of the keyframe see of the old place, if the similarity is right about it.
  std::vector<Sim3Sighting> NeighboursSightings(const Map& map, const Keyframe& keyframe,
                                                const Keyframe& candidate, const Loop& loop,
                                                double radius_px);

  Camera camera_;
  LoopOptions options_;
  LandmarkProjector projector_;
  uint64_t seed_;
};

}  // namespace dynamic_slam
