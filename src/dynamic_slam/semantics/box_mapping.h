#pragma once

#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// From boxes in the camera's images to the same in the prepared ones, which are cut out at a corner and then
// scaled. Edges are those of pixels: the whole image stays the whole image.
struct BoxMapping {
  double left_px = 0, top_px = 0;  // of the cut
  double scale_x = 1, scale_y = 1;

  Box operator()(const Box& box) const {
    return {(box.x - left_px) * scale_x, (box.y - top_px) * scale_y, box.width * scale_x,
            box.height * scale_y};
  }
};

}  // namespace dynamic_slam
