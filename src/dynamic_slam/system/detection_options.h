#pragma once

#include <string>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/semantics/dynamic_score.h"
#include "dynamic_slam/semantics/make_compensation.h"

namespace dynamic_slam {

struct DetectionOptions {
  int every = 1;
  double deadline_ms = 5;
  double latency_ms = 0;
  double first_answer_s = 2;
  CompensationOptions compensation;
  std::string prior = "dynamic_prior";
  DynamicScoreOptions score;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("every", self.every, OptionField{"", 1, 1000, "The detector is asked about each n-th frame only."});
    visit(
        "deadline_ms", self.deadline_ms,
        OptionField{"ms", 0, 10000,
                    "How long tracking, done with extraction, waits for the objects of its frame; later ones "
                    "are predicted."});
    visit("latency_ms", self.latency_ms,
          OptionField{"ms", 0, 60000,
                      "Answers are kept back until the stamps are so much later: a simulated slow network."});
    visit("first_answer_s", self.first_answer_s,
          OptionField{"s", 0, 600,
                      "No map is started from a view before the detector has told who moves in it, for so "
                      "long at most: a start that does not know is often a wrong one."});
    visit("compensation", self.compensation);
    visit("prior", self.prior,
          OptionField{"", 0, 0, "File, or name of one in the configuration, with the scores of classes."});
    visit("score", self.score);
  }
};

}  // namespace dynamic_slam
