#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {

// Pictures of materials, drawn by programs: CV_8UC3 in OpenCV's order blue, green, red. The same seed gives
// the same picture.

// Fine grain with structure at all scales, mean 128, without seams: what makes surfaces differ near by.
cv::Mat DrawGrain();

// A colour of moderate saturation; `light` 0 to 1 says how bright.
cv::Scalar AnyColor(Random& random, double light_low, double light_high, double saturation = 0.5);

// Adds smooth noise at octaves from `largest` down to `smallest` texels, each of this amplitude in grey
// levels.
void AddOctaves(Random& random, double largest, double smallest, double amplitude, cv::Mat& image);

// Indoors. Sizes in texels.
// Plaster with stains and marks.
cv::Mat DrawWall(uint64_t seed, int width, int height, const cv::Scalar& color, double richness);
cv::Mat DrawPoster(uint64_t seed, int width, int height);  // a heading, pictures, writing
cv::Mat DrawScreen(uint64_t seed, int width, int height);  // windows, text, plots
cv::Mat DrawCarpet(uint64_t seed, int side);
cv::Mat DrawTiles(uint64_t seed, int side, int tiles);
cv::Mat DrawWood(uint64_t seed, int width, int height);
cv::Mat DrawCeiling(uint64_t seed, int side, int panels);
cv::Mat DrawDoor(uint64_t seed, int width, int height);
cv::Mat DrawClutter(uint64_t seed, int width, int height);  // the top of a desk: paper, books, cups
cv::Mat DrawBooks(uint64_t seed, int width, int height);    // the front of a shelf

// Outdoors.
cv::Mat DrawFacade(uint64_t seed, int width, int height, double width_m, double height_m);
cv::Mat DrawAsphalt(uint64_t seed, int side);
cv::Mat DrawPaving(uint64_t seed, int side);
cv::Mat DrawLeaves(uint64_t seed, int side);
cv::Mat DrawBark(uint64_t seed, int side);
cv::Mat DrawSky(uint64_t seed, int width, int height);  // u around, v from the zenith to below

// On people.
// With a pattern or plain; with_front: or with a print or an open jacket ahead, u = 0. richness: factor on
// folds and grain.
cv::Mat DrawCloth(uint64_t seed, int side, const cv::Scalar& color, bool with_front, double richness = 1);
cv::Mat DrawFace(uint64_t seed, int side, const cv::Scalar& skin, const cv::Scalar& hair);  // around the head
cv::Mat DrawPlain(uint64_t seed, int side, const cv::Scalar& color, double amplitude);

}  // namespace dynamic_slam
