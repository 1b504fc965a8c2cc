#pragma once

#include <array>
#include <memory>
#include <string>
#include <string_view>

#include "dynamic_slam/semantics/box_compensation.h"
#include "dynamic_slam/semantics/paper_compensation.h"
#include "dynamic_slam/semantics/tracker_compensation.h"

namespace dynamic_slam {

struct CompensationOptions {
  static constexpr std::array<std::string_view, 3> kMethods = {"none", "paper", "tracker"};

  std::string method = "tracker";
  PaperCompensationOptions paper;
  TrackerCompensationOptions tracker;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("method", self.method,
          OptionField{"", 0, 0, "How boxes that the detector misses are filled in.", kMethods});
    visit("paper", self.paper);
    visit("tracker", self.tracker);
  }
};

// The compensation that `options.method` names. With `none` the boxes are the detections of the frame that
// `paper.min_score` lets through.
std::unique_ptr<BoxCompensation> MakeBoxCompensation(const CompensationOptions& options,
                                                     const Camera& camera);

}  // namespace dynamic_slam
