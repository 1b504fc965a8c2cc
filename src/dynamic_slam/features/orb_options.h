#pragma once

#include "dynamic_slam/base/option_field.h"

namespace dynamic_slam {

struct OrbOptions {
  int features = 1000;
  int levels = 8;
  double scale_factor = 1.2;
  int fast_threshold = 16;
  int fast_threshold_min = 7;
  int fast_threshold_starved = 4;
  int threads = 0;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("features", self.features, OptionField{"", 50, 20000, "Keypoints wanted in an image."});
    visit("levels", self.levels, OptionField{"", 1, 12, "Levels of the image pyramid."});
    visit("scale_factor", self.scale_factor, OptionField{"", 1.05, 2.0, "Scale between two pyramid levels."});
    visit("fast_threshold", self.fast_threshold,
          OptionField{"grey levels", 1, 255, "FAST contrast preferred; weaker corners fill the gaps."});
    visit("fast_threshold_min", self.fast_threshold_min,
          OptionField{"grey levels", 1, 255, "FAST contrast that every corner has at least."});
    visit("fast_threshold_starved", self.fast_threshold_starved,
          OptionField{
              "grey levels", 1, 255,
              "The same while no pose is known and dynamic objects leave fewer keypoints than wanted."});
    visit("threads", self.threads,
          OptionField{
              "", 0, 16,
              "Threads that share the pyramid's levels; the same keypoints with any. 0: offline as many "
              "as there are processors, in realtime two fewer, 4 at most."});
  }
};

}  // namespace dynamic_slam
