#include "dynamic_slam/features/orb_extractor.h"

#include <algorithm>
#include <cmath>

#include <opencv2/core.hpp>

#include "dynamic_slam/base/crew.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/features/corner_selection.h"
#include "dynamic_slam/features/fast_detector.h"
#include "dynamic_slam/features/image_pyramid.h"
#include "dynamic_slam/features/smoothing.h"
#include "dynamic_slam/features/steered_brief.h"
#include "dynamic_slam/features/undistortion_table.h"

namespace dynamic_slam {
namespace {

// Bytes between the rows of the blurred levels: whole cache lines, an odd number of them, since rows a power
// of two apart would compete for the same places in the cache.
int Stride(int width) { return 64 * ((width + 63) / 64 | 1); }

// Of the coarse image that tells which corners are deferred.
constexpr int kDeferredCell_px = 8;

// Of a cell's corners the first few are the repeatable ones: so many come before the first deferred one.
constexpr uint8_t kDeferredRounds = 3;

}  // namespace

class OrbExtractor::Impl {
 public:
  Impl(const OrbOptions& options, const Camera& camera, int threads)
      : options_(options),
        width_(camera.width),
        height_(camera.height),
        brief_(Stride(camera.width)),
        undistortion_(camera),
        crew_("orb", threads),
        desks_(crew_.size()),
        pyramid_({camera.width, camera.height}, options.levels, options.scale_factor),
        levels_(pyramid_.size()) {
    for (Desk& desk : desks_) desk.blurred = cv::Mat::zeros(camera.height, Stride(camera.width), CV_8UC1);
    double scale = 1;
    for (size_t i = 0; i < levels_.size(); ++i, scale *= options.scale_factor) {
      levels_[i].smoothed.create(pyramid_.SizeOf(i), CV_8UC1);
      weights_.push_back(1 / scale);
    }
    available_.resize(levels_.size());
    MaskBlindPixels(camera);
  }

  void Extract(const cv::Mat& grey, const cv::Mat& mask, FeatureSet* features) {
    DS_CHECK(grey.type() == CV_8UC1 && grey.cols == width_ && grey.rows == height_,
             "type={} {}x{}, not {}x{}", grey.type(), grey.cols, grey.rows, width_, height_);
    DS_CHECK(mask.empty() || (mask.type() == CV_8UC1 && mask.size() == grey.size()), "type={} {}x{}",
             mask.type(), mask.cols, mask.rows);
    pyramid_.Build(grey);
    crew_.ForEach(levels_.size(), [&](size_t i, size_t member) {
      Level& level = levels_[i];
      Desk& desk = desks_[member];
      level.corners.clear();
      // Not in the paper: on a slightly smoothed image FAST finds more of the same corners again, by a tenth.
      Smooth(pyramid_[i].image, &level.smoothed, &desk.row);
      desk.fast.Detect(level.smoothed, SteeredBrief::kBorder, options_.fast_threshold_min, &level.corners);
      if (!mask.empty()) DropMasked(mask, pyramid_[i], &level);
      if (!blind_.empty()) DropMasked(blind_, pyramid_[i], &level);
      available_[i] = static_cast<int>(level.corners.size());
    });
    ShareOverLevels(options_.features, weights_, available_, &wanted_);
    size_t begin = 0;
    for (size_t i = 0; i < levels_.size(); ++i) {
      levels_[i].begin = begin;
      begin += static_cast<size_t>(std::max(0, std::min(wanted_[i], available_[i])));
    }
    features->keypoints.resize(begin);
    features->descriptors.resize(begin);
    crew_.ForEach(levels_.size(), [&](size_t i, size_t member) {
      Level& level = levels_[i];
      Desk& desk = desks_[member];
      const cv::Size size = pyramid_.SizeOf(i);
      desk.selector.Select(size.width, size.height, wanted_[i], options_.fast_threshold,
                           RoundsLate(pyramid_[i], level, &desk.rounds_late), &level.corners);
      if (!level.corners.empty()) Describe(pyramid_[i], level, static_cast<int>(i), &desk, features);
    });
    pyramid_.ReleaseImage();  // the caller's pixels are not ours to keep
  }

  void SetFeatures(int features) {
    DS_CHECK(features > 0, "features={}", features);
    options_.features = features;
  }

  void SetMinThreshold(int grey_levels) {
    DS_CHECK(grey_levels > 0, "grey_levels={}", grey_levels);
    options_.fast_threshold_min = grey_levels;
  }

  void Defer(std::span<const cv::Rect> areas) {
    has_deferred_ = !areas.empty();
    if (!has_deferred_) return;
    deferred_.create(height_ / kDeferredCell_px + 1, width_ / kDeferredCell_px + 1, CV_8UC1);
    deferred_.setTo(0);
    for (const cv::Rect& area : areas) {
      const cv::Point first = area.tl() / kDeferredCell_px, last = area.br() / kDeferredCell_px;
      const cv::Rect cells = cv::Rect(first, last + cv::Point(1, 1)) & cv::Rect({}, deferred_.size());
      if (!cells.empty()) deferred_(cells).setTo(kDeferredRounds);
    }
  }

 private:
  struct Level {
    cv::Mat smoothed;  // for the corners
    std::vector<Corner> corners;
    size_t begin = 0;  // of its features among those of all levels
  };

  // What a thread needs to look at one level after the other.
  struct Desk {
    FastDetector fast;
    CornerSelector selector;
    cv::Mat blurred;                   // CV_8UC1, for the descriptors
    std::vector<uint8_t> row;          // scratch of Smooth
    std::vector<uint8_t> rounds_late;  // of the corners of the level
  };

  // Makes blind_ when the camera has pixels whose rays cannot be used.
  void MaskBlindPixels(const Camera& camera) {
    if (camera.model == LensModel::kRadialTangential) return;  // sees everywhere
    cv::Mat blind(camera.height, camera.width, CV_8UC1);
    for (int y = 0; y < blind.rows; ++y) {
      for (int x = 0; x < blind.cols; ++x)
        blind.at<uint8_t>(y, x) = camera.CanSee(Eigen::Vector2d(x, y)) ? 0 : 1;
    }
    if (cv::countNonZero(blind) > 0) blind_ = blind;
  }

  static void DropMasked(const cv::Mat& mask, const ImagePyramid::Level& image, Level* level) {
    std::erase_if(level->corners, [&](const Corner& corner) {
      return mask.at<uint8_t>(cvRound(image.FullY(corner.y)), cvRound(image.FullX(corner.x))) != 0;
    });
  }

  std::span<const uint8_t> RoundsLate(const ImagePyramid::Level& image, const Level& level,
                                      std::vector<uint8_t>* rounds_late) const {
    rounds_late->clear();
    if (!has_deferred_) return {};
    for (const Corner& corner : level.corners) {
      rounds_late->push_back(deferred_.at<uint8_t>(cvRound(image.FullY(corner.y)) / kDeferredCell_px,
                                                   cvRound(image.FullX(corner.x)) / kDeferredCell_px));
    }
    return *rounds_late;
  }

  void Describe(const ImagePyramid::Level& image, const Level& level, int octave, Desk* desk,
                FeatureSet* features) const {
    cv::Mat blurred = desk->blurred(cv::Rect({}, image.image.size()));
    SmoothMore(level.smoothed, &blurred, &desk->row);
    size_t i = level.begin;
    for (const Corner& corner : level.corners) {
      Keypoint& keypoint = features->keypoints[i];
      keypoint.raw_x = keypoint.x = image.FullX(corner.x + corner.dx);
      keypoint.raw_y = keypoint.y = image.FullY(corner.y + corner.dy);
      undistortion_.Undistort(&keypoint.x, &keypoint.y);
      keypoint.angle_rad = SteeredBrief::Angle(image.image, corner.x, corner.y);
      keypoint.response = corner.score;
      keypoint.octave = octave;
      features->descriptors[i++] =
          brief_.Describe(blurred.ptr<uint8_t>(corner.y) + corner.x, keypoint.angle_rad);
    }
  }

  OrbOptions options_;
  int width_, height_;
  SteeredBrief brief_;
  UndistortionTable undistortion_;
  cv::Mat blind_;  // CV_8UC1, 1 where not Camera::CanSee; empty when the camera can see everywhere
  bool has_deferred_ = false;
  cv::Mat deferred_;  // CV_8UC1, rounds by which corners of each cell come late
  Crew crew_;
  std::vector<Desk> desks_;  // one for each of the crew
  ImagePyramid pyramid_;
  std::vector<Level> levels_;
  std::vector<double> weights_;          // share of the features: 1 / scale
  std::vector<int> available_, wanted_;  // corners of each level
};

OrbExtractor::OrbExtractor(const OrbOptions& options, const Camera& camera)
    : impl_(std::make_unique<Impl>(options, camera, std::max(1, options.threads))) {}
OrbExtractor::~OrbExtractor() = default;

void OrbExtractor::Extract(const cv::Mat& grey, const cv::Mat& mask, FeatureSet* features) {
  DS_TRACE("tracking/orb");
  impl_->Extract(grey, mask, features);
}

void OrbExtractor::SetFeatures(int features) { impl_->SetFeatures(features); }

void OrbExtractor::SetMinThreshold(int grey_levels) { impl_->SetMinThreshold(grey_levels); }

void OrbExtractor::Defer(std::span<const cv::Rect> areas) { impl_->Defer(areas); }

std::vector<float> OctaveScales(const OrbOptions& options) {
  std::vector<float> scales;
  double scale = 1;
  for (int octave = 0; octave < options.levels; ++octave, scale *= options.scale_factor) {
    scales.push_back(static_cast<float>(scale));
  }
  return scales;
}

}  // namespace dynamic_slam
