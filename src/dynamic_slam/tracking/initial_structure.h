#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/geometry/rolling_shutter.h"
#include "dynamic_slam/geometry/two_view.h"

namespace dynamic_slam {

// Where a view sees a keypoint of the reference view.
struct Sighting {
  uint32_t reference_keypoint = 0;
  Eigen::Vector2d ideal_px = Eigen::Vector2d::Zero();
  double sigma_px = 1;  // scale of its octave
  float raw_y = 0;      // px
};

// What one image sees of the reference view. One reference keypoint has at most one sighting.
struct InitialView {
  double timestamp_s = 0;
  std::vector<Sighting> sightings;
};

// The views of which the first map is made: the reference at the origin, the last one, whose matches gave the
// motion, and some between.
struct InitialViews {
  double reference_timestamp_s = 0;
  std::vector<Sighting> reference;   // all its keypoints: entry i is keypoint i
  std::vector<InitialView> between;  // in the order of time
  InitialView last;                  // one sighting for each match
};

// A two-view motion after bundle adjustment over all views.
struct InitialStructure {
  bool usable = false;
  Rigid3 last_from_reference;
  std::vector<std::optional<Rigid3>> between_from_reference;  // none where too little fits
  std::vector<Eigen::Vector3d> points_in_reference;           // per match
  std::vector<uint8_t> is_good;  // per match: in front of and near its sighting in both outer views
  std::vector<double> costs;     // per match: squared errors of all its sightings, in sigmas, each cut
                                 // off at the outlier limit
  int points = 0;
  // In the unit of the poses; a rolling shutter only.
  std::optional<SteadyMotion> reference_motion, last_motion;

  double MeanCost() const;
};

// As if all rows of an image were read at once: what a wrong motion makes of a rolling shutter helps it to
// fit, so that motions are told apart without.
InitialStructure RefineMotion(const Camera& camera, const TwoViewMotion& motion, const InitialViews& views);

// A rolling shutter: solves a usable structure again, with what the views saw moved to the time of their
// middle rows by the motions that their poses tell. The costs stay.
void CorrectShutters(const Camera& camera, const InitialViews& views, InitialStructure* structure);

// How sure it is that `a` fits the views better than `b`: the mean difference of their costs over matches, in
// standard errors of that mean. A scene close to a plane allows two motions between two views, but not
// between three.
double Preference(const InitialStructure& a, const InitialStructure& b);

}  // namespace dynamic_slam
