#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// All of it in px of the raw image. `boxes` are those of dynamic objects only (dynamic_score.h).

// The mask of Eq. (11): CV_8UC1, height x width, 255 where a pixel's centre lies in a box, else 0. 255 stands
// for the paper's 1, so that the image can be looked at. Boxes may reach out of the image; those that are not
// finite or without area are left out.
cv::Mat DynamicMask(std::span<const Box> boxes, int width, int height);

// The paper gives neither l nor rho. Measured with OpenCV's ORB, matched without an outlier test, on every
// 12th frame of tum_fr1_desk_walk and every 8th of KITTI 00 (boxes on its street): of the people's keypoints
// 18% are kept, of the wall's in their boxes 60%, of the empty room's in the same boxes 67%, of KITTI's 70%.
// With rho 0.3 and 2 px: 18, 53, 59, 63%. With 0.2 and 2 px: 12, 44, 51, 57%; with 0.2 and 4 px: 27, 75, 80,
// 76%. Comparing lengths as Eq. (12) has it, rho 1.3: 72, 84, 82, 66%, hardly a choice at all.
struct SelectiveOptions {
  // A ring as wide as a quarter of the box's side has 1.25 times its area: about as many points as are to be
  // judged. A wider one reaches into other depths, where static points move differently; from 0.1 to 0.5 it
  // makes no difference.
  double ring_ratio = 0.25;
  double min_ring_px = 20;
  // From camera translation a point moves in proportion to 1/depth, so an object at rest that is nearer than
  // what is around it moves more: what is around may be 20% farther away. Not more, as walkers pass in a pan.
  double rho = 0.2;
  // Noise of matches and depth within the ring, which are there however slowly the camera moves. Without it,
  // a camera at rest would cull whatever is at rest too.
  double min_tolerance_px = 3;
  int min_static_points = 5;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("ring_ratio", self.ring_ratio,
          OptionField{"", 0.01, 10,
                      "How far around a box static points are looked at, over the box's mean side (l)."});
    visit("min_ring_px", self.min_ring_px, OptionField{"px", 1, 1000, "The same at least."});
    visit("rho", self.rho,
          OptionField{"", 0, 10,
                      "A keypoint in a box may differ from the static ones around by so much of their mean "
                      "displacement (rho of Eq. 12)."});
    visit("min_tolerance_px", self.min_tolerance_px,
          OptionField{"px", 0, 100, "The same at least, as positions are noisy."});
    visit("min_static_points", self.min_static_points,
          OptionField{"", 1, 1000, "With fewer around a box, static points from farther away are used."});
  }
};

enum class KeypointJudgement {
  kStatic,   // in no box: used for tracking
  kKept,     // in a box, but moves like the static points around it: used for tracking
  kCulled,   // in a box, and moves differently
  kUnknown,  // in a box, but without a match in the last frame, or without static points to compare with; or
             // its position is not finite
};

// What a box's keypoints were compared with.
struct SelectiveBox {
  // Mean displacement of static points around the box; none when the image has too few.
  std::optional<Eigen::Vector2d> static_displacement_px;
  double ring_px = 0;     // the distance l that was used
  int static_points = 0;  // within it
};

struct SelectiveResult {
  std::vector<KeypointJudgement> keypoints;  // one for each keypoint
  std::vector<SelectiveBox> boxes;           // one for each box
};

// Algorithm 2, selective tracking. positions_px: the keypoints of the current frame. displacements_px, of the
// same length: how each moved since the last frame; none, or not finite: no match. boxes: where dynamic
// objects are in the current frame.
//
// A keypoint in a box is kept where |d - S| <= max(rho |S|, min_tolerance_px), d its displacement and S the
// mean displacement of the static points, those in no box at all, at most l outside the box. In several
// boxes: where all of them say so.
//
// Deviations. Eq. (12) compares lengths, |d| <= rho |S|: so it keeps the person whom the camera follows, who
// stands still in the image, and with a camera at rest it culls everything. The text says "the relative
// displacement between the dynamic feature point and the static feature point", and that is what is compared.
// Eq. (13) averages displacements of projected landmarks; here they are those of matches, as in Algorithm 2,
// and the mean is of vectors, which is needed for that difference. Where fewer than min_static_points are
// within l, l doubles until there are enough, as a person who fills half of the view leaves no ring; where
// the whole image has too few, nothing is judged.
SelectiveResult SelectiveTracking(const SelectiveOptions& options,
                                  std::span<const Eigen::Vector2d> positions_px,
                                  std::span<const std::optional<Eigen::Vector2d>> displacements_px,
                                  std::span<const Box> boxes);

}  // namespace dynamic_slam
