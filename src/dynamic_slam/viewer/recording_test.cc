#include <gtest/gtest.h>

#include "dynamic_slam/viewer/map_picture.h"
