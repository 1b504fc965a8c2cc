#pragma once

#include "dynamic_slam/base/export.h"

namespace dynamic_slam {

enum class RunMode {
  kOffline,   // one thread, one fixed order of the stages: the same input gives the same bytes
  kRealtime,  // the stages beside tracking in threads of their own
};

DYNAMIC_SLAM_API const char* Name(RunMode mode);

}  // namespace dynamic_slam
