#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/semantics/dynamic_score.h"

namespace dynamic_slam {

enum class DetectionState : uint8_t {
  kOff,       // there is no detector
  kOnTime,    // the boxes are those of this frame
  kNotAsked,  // this frame is not every n-th, or the detector is busy with an earlier one
  kLate,      // the detector was asked about this frame, and has not answered yet
  kFailed,    // it answered that it cannot
};

const char* Name(DetectionState state);

// What an answer that came late told of an earlier frame: objects that nobody knew of then.
struct LateObjects {
  FrameId frame;
  std::vector<DynamicBox> boxes;
};

// The objects in a frame, as far as they are known when tracking needs them.
struct FrameObjects {
  DetectionState state = DetectionState::kOff;
  std::string reason;  // of a failure
  std::vector<DynamicBox> boxes;
  // The frame that the detector was asked about and has not answered: who came since it was asked before is
  // not known. Not valid when there is none, or when it is too late to hope for an answer.
  FrameId untold_from;
  FrameId told_to;                // the last frame that it has answered about
  std::vector<LateObjects> late;  // oldest first
};

}  // namespace dynamic_slam
