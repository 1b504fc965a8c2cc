#pragma once

#include <vector>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/features/features.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/essential.h"

namespace dynamic_slam {

// Matches between two images of a clip, in ideal px relative to the principal point.
struct ImagePair {
  std::vector<PixelPair> matches;
  double motion_px = 0;  // median distance of matches
};

ImagePair MatchImages(const Camera& camera, const FeatureSet& first, const FeatureSet& second);

// How many matches fit a motion: the sum of 1 - (error / 2 px)^2 over those within 2 px.
double RotationScore(const Camera& camera, const ImagePair& pair, Random* random);
double EpipolarScore(const Camera& camera, const ImagePair& pair, Random* random);

}  // namespace dynamic_slam
