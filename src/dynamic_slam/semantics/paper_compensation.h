#pragma once

#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/semantics/replaying_compensation.h"

namespace dynamic_slam {

struct PaperCompensationOptions {
  double min_score = 0.4;
  int mean_frames = 5;
  double max_acceleration_px = 20;
  int max_misses = 2;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("min_score", self.min_score,
          OptionField{"", 0, 1, "Detections with a lower score are not looked at."});
    visit("mean_frames", self.mean_frames,
          OptionField{"", 3, 5, "A box moves on with its mean velocity over so many frames (k of Eq. 5)."});
    visit("max_acceleration_px", self.max_acceleration_px,
          OptionField{"px", 1, 200,
                      "Change of a box's velocity at most, per frame^2 at 30 frames per second and 640 px of "
                      "width (a_max of Eq. 4)."});
    visit("max_misses", self.max_misses,
          OptionField{"", 0, 30, "A box is given up when it is missing in more consecutive frames."});
  }
};

// A box of the list D of Algorithm 1, and what Eq. (5) needs to know of its past.
struct PaperBox {
  CompensatedBox box;                             // its rectangle may reach out of the image
  std::vector<Eigen::Vector2d> displacements_px;  // of the centre, frame to frame, the last k, oldest first
};

// The compensation as the paper has it: Eq. (4) to (6) and Algorithm 1. Where the text leaves gaps, this is
// what happens (docs/paper_map.md gives the reasons): a box and a detection belong together only when their
// classes are equal, one to one, the nearest pairs first; a detection without a box begins one; a box that
// has left the image is given up; a new box stands still until its velocity is known. The camera's rotation
// is not used.
class PaperCompensation : public ReplayingCompensation<std::vector<PaperBox>> {
 public:
  // A camera without frame rate is taken to have 30 frames per second.
  PaperCompensation(const PaperCompensationOptions& options, const Camera& camera);

 protected:
  std::vector<Detection> Usable(std::span<const Detection> detections) const override;
  void Advance(const CompensationInput& input, std::vector<PaperBox>* boxes) override;
  std::vector<CompensatedBox> BoxesOf(const std::vector<PaperBox>& boxes) const override;

 private:
  // The mean displacement over the last k frames, px.
  Eigen::Vector2d MeanDisplacement(const PaperBox& box) const;

  PaperCompensationOptions options_;
  Camera camera_;
  double a_max_px_;  // per frame^2 of this camera
};

}  // namespace dynamic_slam
