#pragma once

// What libdynamic_slam.so offers to other programs; everything else is hidden in it. On declarations of the
// public headers (docs/library.md).
#define DYNAMIC_SLAM_API __attribute__((visibility("default")))
