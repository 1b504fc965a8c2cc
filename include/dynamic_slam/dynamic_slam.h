#pragma once

// Everything that a program needs that uses Dynamic-SLAM as a library (docs/library.md).

#include "dynamic_slam/base/input_error.h"
#include "dynamic_slam/eval/metrics.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/map_view.h"
#include "dynamic_slam/options.h"
#include "dynamic_slam/results.h"
#include "dynamic_slam/system.h"
