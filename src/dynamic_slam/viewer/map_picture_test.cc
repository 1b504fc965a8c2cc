#include "dynamic_slam/viewer/map_picture.h"

#include <gtest/gtest.h>
