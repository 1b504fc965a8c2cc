#pragma once

#include <memory>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/semantics/detector.h"

namespace dynamic_slam {

struct RemoteDetectorOptions {
  double timeout_s = 0.3;
  bool compressed = true;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("timeout_s", self.timeout_s,
          OptionField{"s", 0.01, 0.9,
                      "How long an answer of the detector is waited for before it counts as lost."});
    visit("compressed", self.compressed,
          OptionField{"", 0, 1,
                      "Images go to the detector as JPEG, on detector/image/compressed, and not raw."});
  }
};

// A detector_node, here or on another machine: publishes each image that it is asked about on
// `detector/image`, and takes the answer with the same stamp from `detector/detections`. An answer that does
// not come in time, and one for a later image in its place, is a failure with a reason.
//
// class_names: those that are told apart. Each other name in an answer is the class "other", which is
// appended.
std::unique_ptr<Detector> MakeRemoteDetector(const RemoteDetectorOptions& options,
                                             std::vector<std::string> class_names);

}  // namespace dynamic_slam
