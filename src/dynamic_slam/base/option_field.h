#pragma once

#include <span>
#include <string_view>

namespace dynamic_slam {

// What is known of one option beside its name and value. Every options struct lists its fields once:
//
//   struct OrbOptions {
//     int features = 1000;
//     template <class Self, class Visitor>
//     static void VisitFields(Self& self, Visitor&& visit) {
//       visit("features", self.features, OptionField{"", 50, 20000, "Keypoints wanted in an image."});
//     }
//   };
//
// and a struct that holds others visits them by name: visit("orb", self.orb). From this one list come YAML
// reading and writing, range checks, unknown-key errors, --set and the documentation.
// Field types: bool, int, double, uint64_t, std::string. A string that is one of a few words lists them, in
// static storage: OptionField{"", 0, 0, "How time passes.", kModes}.
struct OptionField {
  std::string_view unit;  // "px", "rad", "deg", "s", ... or "" for a pure number
  double low = 0;         // smallest and largest value allowed; not looked at for bool and string
  double high = 0;
  std::string_view help;                         // one sentence
  std::span<const std::string_view> words = {};  // of a string: the values allowed, any when there are none
};

}  // namespace dynamic_slam
