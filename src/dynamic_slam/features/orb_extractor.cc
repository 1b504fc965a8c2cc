#include "dynamic_slam/features/orb_extractor.h"

#include <algorithm>
#include <cmath>

#include <opencv2/core.hpp>

#include "dynamic_slam/base/crew.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/features/corner_selection.h"
#include "dynamic_slam/features/downscaler.h"
#include "dynamic_slam/features/fast_detector.h"
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
        levels_(options.levels) {
    for (Desk& desk : desks_) desk.blurred = cv::Mat::zeros(camera.height, Stride(camera.width), CV_8UC1);
    DS_CHECK(options.levels >= 1 && options.scale_factor > 1, "levels={} scale_factor={}", options.levels,
             options.scale_factor);
    double scale = 1;
    for (Level& level : levels_) {
      const int width = std::max(1, cvRound(width_ / scale)), height = std::max(1, cvRound(height_ / scale));
      level.image.create(height, width, CV_8UC1);
      level.smoothed.create(height, width, CV_8UC1);
      level.scale_x = static_cast<float>(width_) / static_cast<float>(width);
      level.scale_y = static_cast<float>(height_) / static_cast<float>(height);
      weights_.push_back(1 / scale);
      scale *= options.scale_factor;
    }
    for (size_t i = 1; i < levels_.size(); ++i) {
      downscalers_.emplace_back(levels_[i - 1].image.size(), levels_[i].image.size());
    }
    available_.resize(levels_.size());
    MaskBlindPixels(camera);
  }

  void Extract(const cv::Mat& grey, const cv::Mat& mask, FeatureSet* features) {
    DS_CHECK(grey.type() == CV_8UC1 && grey.cols == width_ && grey.rows == height_,
             "type={} {}x{}, not {}x{}", grey.type(), grey.cols, grey.rows, width_, height_);
    DS_CHECK(mask.empty() || (mask.type() == CV_8UC1 && mask.size() == grey.size()), "type={} {}x{}",
             mask.type(), mask.cols, mask.rows);
    levels_[0].image = grey;  // shares the pixels
    for (size_t i = 1; i < levels_.size(); ++i)
      downscalers_[i - 1].Run(levels_[i - 1].image, &levels_[i].image);
    crew_.ForEach(levels_.size(), [&](size_t i, size_t member) {
      Level& level = levels_[i];
      Desk& desk = desks_[member];
      level.corners.clear();
      // Not in the paper: on a slightly smoothed image FAST finds more of the same corners again, by a tenth.
      Smooth(level.image, &level.smoothed, &desk.row);
      desk.fast.Detect(level.smoothed, SteeredBrief::kBorder, options_.fast_threshold_min, &level.corners);
      if (!mask.empty()) DropMasked(mask, &level);
      if (!blind_.empty()) DropMasked(blind_, &level);
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
      desk.selector.Select(level.image.cols, level.image.rows, wanted_[i], options_.fast_threshold,
                           RoundsLate(level, &desk.rounds_late), &level.corners);
      if (!level.corners.empty()) Describe(level, static_cast<int>(i), &desk, features);
    });
    levels_[0].image = cv::Mat();  // the caller's pixels are not ours to keep
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
    cv::Mat image;     // CV_8UC1
    cv::Mat smoothed;  // for the corners
    float scale_x, scale_y;  // full-resolution px per px; the two differ as sizes are whole numbers
    std::vector<Corner> corners;
    size_t begin = 0;  // of its features among those of all levels

    // Pixel centres are at whole numbers, so the image's corner is at -0.5 at every level.
    float FullX(float x) const { return (x + 0.5f) * scale_x - 0.5f; }
    float FullY(float y) const { return (y + 0.5f) * scale_y - 0.5f; }
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

  static void DropMasked(const cv::Mat& mask, Level* level) {
    std::erase_if(level->corners, [&](const Corner& corner) {
      return mask.at<uint8_t>(cvRound(level->FullY(corner.y)), cvRound(level->FullX(corner.x))) != 0;
    });
  }

  std::span<const uint8_t> RoundsLate(const Level& level, std::vector<uint8_t>* rounds_late) const {
    rounds_late->clear();
    if (!has_deferred_) return {};
    for (const Corner& corner : level.corners) {
      rounds_late->push_back(deferred_.at<uint8_t>(cvRound(level.FullY(corner.y)) / kDeferredCell_px,
                                                   cvRound(level.FullX(corner.x)) / kDeferredCell_px));
    }
    return *rounds_late;
  }

  void Describe(const Level& level, int octave, Desk* desk, FeatureSet* features) const {
    cv::Mat blurred = desk->blurred(cv::Rect({}, level.image.size()));
    SmoothMore(level.smoothed, &blurred, &desk->row);
    size_t i = level.begin;
    for (const Corner& corner : level.corners) {
      Keypoint& keypoint = features->keypoints[i];
      keypoint.raw_x = keypoint.x = level.FullX(corner.x + corner.dx);
      keypoint.raw_y = keypoint.y = level.FullY(corner.y + corner.dy);
      undistortion_.Undistort(&keypoint.x, &keypoint.y);
      keypoint.angle_rad = SteeredBrief::Angle(level.image, corner.x, corner.y);
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
  std::vector<Level> levels_;
  std::vector<double> weights_;          // share of the features: 1 / scale
  std::vector<Downscaler> downscalers_;  // to each level but the finest
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
