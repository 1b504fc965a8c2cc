#include "dynamic_slam/tracking/tracking_state.h"

namespace dynamic_slam {

const char* Name(TrackingState state) {
  switch (state) {
    case TrackingState::kInitialising:
      return "initialising";
    case TrackingState::kTracking:
      return "tracking";
    case TrackingState::kLost:
      return "lost";
  }
  return "";
}

}  // namespace dynamic_slam
