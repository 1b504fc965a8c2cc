#pragma once

#include <utility>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/semantics/frame_objects.h"

namespace dynamic_slam {

// The last poses, since one was found by its looks, until an image that is tracked from it confirms it: of
// the next frame, or, where the detector is late, of the first frame that knows who stood in the one that was
// found. People look like themselves, and where one comes into a view that a map of him remembers, the camera
// is found where it was then.
class UnconfirmedPoses {
 public:
  // A pose more. is_found: by its looks, else from the pose before.
  void Add(FrameId frame, bool is_found, const FrameObjects& objects) {
    if (is_found) found_ = frame;
    const bool is_told =
        !objects.untold_from.IsValid() || (objects.told_to.IsValid() && objects.told_to >= found_);
    count_ = is_found || (count_ > 0 && !is_told) ? count_ + 1 : 0;
  }

  bool Any() const { return count_ > 0; }

  // They are none. Returns how many they were.
  int Withdraw() { return std::exchange(count_, 0); }

 private:
  FrameId found_;
  int count_ = 0;
};

}  // namespace dynamic_slam
