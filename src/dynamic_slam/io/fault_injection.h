#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "dynamic_slam/base/options.h"
#include "dynamic_slam/io/frame_source.h"

namespace dynamic_slam {

// What goes wrong with a camera: the share of the frames to which each happens, by chance, between two times.
struct FaultOptions {
  double drop = 0, black = 0, blur = 0, exposure = 0, freeze = 0, resize = 0, stamp = 0, swap = 0;
  double from = 0, to = 0;
  uint64_t seed = 1;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("drop", self.drop, OptionField{"", 0, 1, "Share of the frames that never arrive."});
    visit("black", self.black, OptionField{"", 0, 1, "Share of the frames that are black."});
    visit("blur", self.blur, OptionField{"", 0, 1, "Share of the frames with motion blur of 5 to 25 px."});
    visit("exposure", self.exposure,
          OptionField{"", 0, 1, "Share of the frames that are 4 times too dark to 4 times too bright."});
    visit("freeze", self.freeze, OptionField{"", 0, 1, "Share of the frames that show the image before."});
    visit("resize", self.resize, OptionField{"", 0, 1, "Share of the frames that have half the size."});
    visit("stamp", self.stamp,
          OptionField{"", 0, 1, "Share of the frames whose stamp is none, a second old, or the one before."});
    visit("swap", self.swap, OptionField{"", 0, 1, "Share of the frames that come after the next one."});
    visit("from", self.from, OptionField{"s", 0, 1e9, "No fault earlier, since the first frame."});
    visit("to", self.to, OptionField{"s", 0, 1e9, "No fault later; 0: until the end."});
    visit("seed", self.seed, OptionField{"", 0, 0, "The same seed gives the same faults."});
  }
};

// "drop=0.05,black=0.02,from=2" as options. Throws InputError that names `what`.
FaultOptions ParseFaults(const std::string& text, const std::string& what);

// The source with faults, which pass the same checks as files do: what those refuse is among the Problems().
// The first frame has none.
std::unique_ptr<FrameSource> InjectFaults(std::unique_ptr<FrameSource> source, const FaultOptions& options);

}  // namespace dynamic_slam
