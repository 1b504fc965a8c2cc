#include "dynamic_slam/diagnosis/clip_measures.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "dynamic_slam/diagnosis/clip_motion.h"
#include "dynamic_slam/features/orb_extractor.h"
#include "dynamic_slam/io/image_preparer.h"

namespace dynamic_slam {
namespace {

constexpr size_t kMostImages = 60;
constexpr size_t kMostPairs = 12;
constexpr double kPairMotion = 0.05;  // of the image's width
constexpr size_t kFewestMatches = 50;

struct ClipImage {
  double timestamp_s = 0;
  FeatureSet features;
};

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Camera NominalCamera(const cv::Size& size) {
  Camera camera;
  camera.width = size.width;
  camera.height = size.height;
  camera.fx = camera.fy = size.width;
  camera.cx = (size.width - 1) / 2.0;
  camera.cy = (size.height - 1) / 2.0;
  return camera;
}

// How far points move in a third of a second, px.
double MotionPx(const Camera& camera, const std::vector<ClipImage>& images) {
  constexpr double kSeconds = 1.0 / 3;
  std::vector<double> motions;
  for (size_t i = 0; i < images.size(); i += 5) {
    const auto later = std::find_if(
        images.begin() + static_cast<ptrdiff_t>(i), images.end(),
        [&](const ClipImage& image) { return image.timestamp_s >= images[i].timestamp_s + 0.9 * kSeconds; });
    if (later == images.end()) break;
    const ImagePair pair = MatchImages(camera, images[i].features, later->features);
    if (pair.matches.size() >= kFewestMatches) motions.push_back(pair.motion_px);
  }
  return Median(motions);
}

// Images between which points move far enough, spread over the clip.
std::vector<ImagePair> FarPairs(const Camera& camera, const std::vector<ClipImage>& images) {
  std::vector<ImagePair> pairs;
  const size_t every = std::max<size_t>(1, images.size() / kMostPairs);
  size_t apart = 1;
  for (size_t i = 0; i < images.size() && pairs.size() < kMostPairs; i += every) {
    for (size_t j = i + std::max<size_t>(1, apart / 2); j < images.size(); ++j) {
      ImagePair pair = MatchImages(camera, images[i].features, images[j].features);
      if (pair.matches.size() < kFewestMatches) break;
      if (pair.motion_px < kPairMotion * camera.width) continue;
      pairs.push_back(std::move(pair));
      apart = j - i;
      break;
    }
  }
  return pairs;
}

}  // namespace

double EdgeWidth(const cv::Mat& grey) {
  // Of the steps between neighbours among blocks of 8 px, those that are strong, and the largest step from px
  // to px there: a sharp edge has all of its step in one or two px.
  constexpr int kBlock = 8;
  constexpr float kStrong = 25;  // grey levels
  constexpr size_t kFewest = 20;
  cv::Mat1f image, blocks;
  grey.convertTo(image, CV_32F);
  cv::GaussianBlur(image, image, cv::Size(), 0.7);  // noise is no edge
  cv::resize(image, blocks, cv::Size(grey.cols / kBlock, grey.rows / kBlock), 0, 0, cv::INTER_AREA);
  std::vector<double> widths;
  for (int row = 0; row < blocks.rows; ++row) {
    for (int column = 0; column + 1 < blocks.cols; ++column) {
      const float step = std::abs(blocks(row, column + 1) - blocks(row, column));
      if (step < kStrong) continue;
      // From the middle of one block to that of the other, along each row of pixels.
      const int left = column * kBlock + kBlock / 2, right = left + kBlock;
      for (int y = row * kBlock; y < (row + 1) * kBlock; y += 2) {
        float low = image(y, left), high = low, steepest = 0;
        for (int x = left; x < right; ++x) {
          steepest = std::max(steepest, std::abs(image(y, x + 1) - image(y, x)));
          low = std::min(low, image(y, x + 1));
          high = std::max(high, image(y, x + 1));
        }
        if (high - low >= kStrong && steepest > 0) widths.push_back((high - low) / steepest);
      }
    }
  }
  return widths.size() < kFewest ? 0 : Median(widths);
}

ClipMeasures MeasureClip(const std::optional<Camera>& given_camera, FrameSource* source) {
  const Camera camera = given_camera.value_or(NominalCamera(source->ImageSize()));
  ImagePreparer preparer(camera, {});
  OrbOptions orb;
  orb.features = ClipMeasures::kWantedKeypoints;
  OrbExtractor extractor(orb, camera);
  const size_t every = std::max<size_t>(1, source->FrameCount() / kMostImages);
  ClipMeasures measures;
  std::vector<ClipImage> images;
  std::vector<double> greys, darks, brights, widths, counts;
  size_t index = 0;
  while (images.size() < kMostImages + 1) {
    const std::optional<SourceImage> image = source->Next();
    if (!image.has_value()) break;
    if (index++ % every != 0) continue;
    cv::Mat grey;
    preparer.Prepare(image->image, &grey);
    const double pixels = static_cast<double>(grey.total());
    constexpr double kBlack = 10, kWhite = 250;
    greys.push_back(cv::mean(grey)[0]);
    darks.push_back(cv::countNonZero(grey < kBlack) / pixels);
    brights.push_back(cv::countNonZero(grey >= kWhite) / pixels);
    if (const double width = EdgeWidth(grey); width > 0) widths.push_back(width);
    images.push_back({image->timestamp_s, {}});
    extractor.Extract(grey, {}, &images.back().features);
    counts.push_back(static_cast<double>(images.back().features.size()));
  }
  measures.images = images.size();
  measures.grey = Median(greys);
  measures.dark_share = Median(darks);
  measures.bright_share = Median(brights);
  measures.edge_width_px = 2 * widths.size() < images.size() ? 0 : Median(widths);
  measures.keypoints = Median(counts);
  measures.motion_share = MotionPx(camera, images) / camera.width;

  const std::vector<ImagePair> pairs = FarPairs(camera, images);
  measures.pairs = pairs.size();
  if (pairs.empty()) return measures;
  Random random(1);
  std::vector<double> rotation_shares;
  for (const ImagePair& pair : pairs) {
    const double rotation = RotationScore(camera, pair, &random);
    const double any = std::max(rotation, EpipolarScore(camera, pair, &random));
    rotation_shares.push_back(any > 0 ? rotation / any : 0);
  }
  measures.rotation_share = Median(rotation_shares);
  return measures;
}

}  // namespace dynamic_slam
