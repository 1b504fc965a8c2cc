#pragma once

#include <map>
#include <span>
#include <vector>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/semantics/box_compensation.h"

namespace dynamic_slam {

struct DynamicScoreOptions {
  double threshold = 5;
  double label_evidence = 1.5;
  double swap_probability = 0.02;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("threshold", self.threshold,
          OptionField{"", 0, 10, "An object with a higher score, 0 to 10, counts as dynamic."});
    visit("label_evidence", self.label_evidence,
          OptionField{"", 0.01, 10,
                      "Log of how much likelier a detector names an object's own class than another one, "
                      "for a detection that it trusts fully."});
    visit("swap_probability", self.swap_probability,
          OptionField{"", 0.001, 0.5,
                      "How likely the next detection of an object is in truth one of another object."});
  }
};

// A box and how dynamic the object in it is.
struct DynamicBox : CompensatedBox {
  double probability = 0;    // P(dynamic | all detections so far)
  double dynamic_score = 0;  // the same from 0 (static) to 10 (dynamic), as the paper counts
  bool is_dynamic = false;   // dynamic_score > threshold
};

// Whether the objects in tracked boxes are dynamic, as maximum a posteriori over frames (Eq. 7 to 9).
//
// The condition c of an object, static or dynamic, is not seen: a detector sees classes. Prior knowledge ties
// them, P(c = dynamic | class i) = score_i / 10, and the detector errs in the class. So the belief is held
// over the class of each object, b_K(i) = P(class i | d_1..K), with d_K the detection in frame K. For each:
//
//   Eq. (9)  b-(i) = sum_j P(i | j) b_K-1(j) = (1 - q) b_K-1(i) + q / N
//            objects keep their class; with probability q = swap_probability the track now follows another
//            object, any of N classes.
//   Eq. (7)  b_K(i) ~ P(d_K | i) b-(i),   P(d_K | i) ~ exp(s w) where d_K names class i, else 1
//            s is the trust in d_K and w = label_evidence.
//   Eq. (8)  c* = dynamic where P(c = dynamic | d_1..K) = sum_i b_K(i) score_i / 10 > threshold / 10
//
// The first detection sets P(C): b_0 is its class, after one step of Eq. (9). Class scores enter as a prior,
// once, and not as a measurement in each frame: a car that is seen a hundred times is not more dynamic for
// it. A few wrong labels do not flip an object whose class was clear; as many as it takes for a lasting
// change do.
//
// A frame without a detection measures nothing and the belief stays as it was: "the box of the current frame
// will also be judged as the same" (3.2). It must not fade, or people whom a detector loses for a second
// become furniture. How long an unseen object goes on is the compensation's decision.
class DynamicScore {
 public:
  // class_scores: 0 to 10, by class id (dynamic_prior.h); none: there are no boxes.
  DynamicScore(const DynamicScoreOptions& options, std::vector<double> class_scores);

  // The boxes of the next frame as the compensation has them; each in turn with its score. A detection counts
  // once, by missed_frames, in the frame in which it is first told, be it late; of several that are told at
  // once the last counts. A track that is gone is
  // remembered for BoxCompensation::kHistoryFrames, as a late result may bring it back, and forgotten then.
  std::vector<DynamicBox> Update(std::span<const CompensatedBox> boxes);

  // A box of an earlier frame, by what is known of its track now.
  DynamicBox Judge(const CompensatedBox& box) const;

  // Forgets all tracks.
  void Reset();

  // Tracks that are remembered.
  size_t size() const { return tracks_.size(); }

 private:
  struct Track {
    std::vector<double> belief;  // b(i), by class id; the sum is 1
    int last_detection = 0;      // the last frame whose detection is counted, in calls of Update
    int last_frame = 0;          // the last frame with a box
  };

  Track Begin(int class_id) const;
  DynamicBox Judge(const CompensatedBox& box, const Track& track) const;        // Eq. (8)
  void Predict(std::vector<double>* belief) const;                              // Eq. (9)
  void Measure(int class_id, double trust, std::vector<double>* belief) const;  // Eq. (7)

  DynamicScoreOptions options_;
  std::vector<double> class_scores_;
  std::map<int, Track> tracks_;  // by track id
  int frame_ = 0;                // calls of Update
};

}  // namespace dynamic_slam
