#include "dynamic_slam/semantics/frame_objects.h"

namespace dynamic_slam {

const char* Name(DetectionState state) {
  switch (state) {
    case DetectionState::kOff:
      return "off";
    case DetectionState::kOnTime:
      return "on time";
    case DetectionState::kNotAsked:
      return "not asked";
    case DetectionState::kLate:
      return "late";
    case DetectionState::kFailed:
      return "failed";
  }
  return "";
}

}  // namespace dynamic_slam
