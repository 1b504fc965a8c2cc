#include "dynamic_slam/io/image_preparer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/image_file.h"

namespace dynamic_slam {
namespace {

struct BayerPattern {
  const char* name;        // colours of pixels (0, 0), (1, 0), (0, 1), (1, 1)
  int to_grey, to_colour;  // OpenCV names a pattern by the pixels (1, 1) and (2, 1)
};
constexpr std::array<BayerPattern, 4> kBayerPatterns = {
    {{"rggb", cv::COLOR_BayerBG2GRAY, cv::COLOR_BayerBG2BGR},
     {"bggr", cv::COLOR_BayerRG2GRAY, cv::COLOR_BayerRG2BGR},
     {"grbg", cv::COLOR_BayerGB2GRAY, cv::COLOR_BayerGB2BGR},
     {"gbrg", cv::COLOR_BayerGR2GRAY, cv::COLOR_BayerGR2BGR}}};
constexpr BayerPattern kNoBayer = {"none", -1, -1};

// The pattern of an image that begins at `corner` of a sensor with the named one: an odd number of columns or
// rows cut off shifts it.
BayerPattern BayerAt(std::string pattern, const cv::Point& corner) {
  if (pattern == "none") return kNoBayer;
  const auto is = [&pattern](const BayerPattern& candidate) { return pattern == candidate.name; };
  if (std::none_of(kBayerPatterns.begin(), kBayerPatterns.end(), is)) {
    const std::vector<std::string> names = {"none", "rggb", "bggr", "grbg", "gbrg"};
    throw InputError("image.bayer",
                     fmt::format("the pattern '{}' is not known.{}", pattern, DidYouMean(pattern, names)),
                     fmt::format("Known are: {}.", fmt::join(names, ", ")));
  }
  if (corner.x % 2 == 1) {
    std::swap(pattern[0], pattern[1]);
    std::swap(pattern[2], pattern[3]);
  }
  if (corner.y % 2 == 1) {
    std::swap(pattern[0], pattern[2]);
    std::swap(pattern[1], pattern[3]);
  }
  return *std::find_if(kBayerPatterns.begin(), kBayerPatterns.end(), is);
}

cv::Rect CropOf(const Camera& raw, const ImageOptions& options) {
  const int width = options.crop_width > 0 ? options.crop_width : raw.width - options.crop_left;
  const int height = options.crop_height > 0 ? options.crop_height : raw.height - options.crop_top;
  const cv::Rect crop(options.crop_left, options.crop_top, width, height);
  const auto refuse = [&crop](const std::string& reason, const std::string& remedy) {
    throw InputError(
        "image.crop_left, crop_top, crop_width, crop_height",
        fmt::format("the crop of {} x {} px at ({}, {}) {}", crop.width, crop.height, crop.x, crop.y, reason),
        remedy);
  };
  if (width < Camera::kMinSizePx || height < Camera::kMinSizePx || crop.x + width > raw.width ||
      crop.y + height > raw.height) {
    refuse(fmt::format("is outside of the images of {} x {} px, or smaller than {} px", raw.width, raw.height,
                       Camera::kMinSizePx),
           "Choose a part of the raw images.");
  }
  if (!(raw.cx > crop.x && raw.cx < crop.x + width && raw.cy > crop.y && raw.cy < crop.y + height)) {
    refuse(fmt::format("leaves out the principal point ({}, {})", raw.cx, raw.cy),
           "Choose a part that holds it, and ignore the rest with image.mask.");
  }
  return crop;
}

// Pixel (0, 0) is the centre of the top left pixel, so that it is the corner (-0.5, -0.5) that stays under
// scaling. Distortion coefficients are of normalised coordinates and stay.
Camera PreparedCamera(const Camera& raw, const cv::Rect& crop, int resize_width) {
  Camera camera = raw;
  camera.cx -= crop.x;
  camera.cy -= crop.y;
  camera.width = crop.width;
  camera.height = crop.height;
  camera.readout_s *= static_cast<double>(crop.height) / raw.height;
  if (resize_width == 0 || resize_width == crop.width) return camera;
  camera.width = resize_width;
  camera.height = static_cast<int>(std::lround(static_cast<double>(crop.height) * resize_width / crop.width));
  if (camera.width < Camera::kMinSizePx || camera.height < Camera::kMinSizePx) {
    throw InputError(
        "image.resize_width",
        fmt::format("{} px makes images of {} x {} px", resize_width, camera.width, camera.height),
        fmt::format("Both sides must have at least {} px.", Camera::kMinSizePx));
  }
  // The height is rounded, so that the two scales differ slightly.
  const double scale_x = static_cast<double>(camera.width) / crop.width;
  const double scale_y = static_cast<double>(camera.height) / crop.height;
  camera.fx *= scale_x;
  camera.fy *= scale_y;
  camera.cx = (camera.cx + 0.5) * scale_x - 0.5;
  camera.cy = (camera.cy + 0.5) * scale_y - 0.5;
  return camera;
}

// Averages when it makes the image smaller, so that nothing is aliased; both keep the corners in place.
void Resize(const cv::Mat& from, const cv::Size& size, cv::Mat* to) {
  cv::resize(from, *to, size, 0, 0, size.width < from.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
}

const Camera& Validated(const Camera& camera, const ImageOptions& options) {
  camera.Validate();
  CheckOptions(options);
  return camera;
}

}  // namespace

ImagePreparer::ImagePreparer(const Camera& raw_camera, const ImageOptions& options)
    : options_(options),
      raw_size_(raw_camera.width, raw_camera.height),
      crop_(CropOf(Validated(raw_camera, options), options)),
      camera_(PreparedCamera(raw_camera, crop_, options.resize_width)) {
  const BayerPattern bayer = BayerAt(options.bayer, crop_.tl());
  bayer_to_grey_ = bayer.to_grey;
  bayer_to_colour_ = bayer.to_colour;
  camera_.Validate();
  if (!options.mask.empty()) mask_ = ReadMask(options.mask);
}

BoxMapping ImagePreparer::box_mapping() const {
  return {static_cast<double>(crop_.x), static_cast<double>(crop_.y),
          static_cast<double>(camera_.width) / crop_.width,
          static_cast<double>(camera_.height) / crop_.height};
}

cv::Mat ImagePreparer::ReadMask(const std::string& file) const {
  std::string reason;
  cv::Mat image = ReadImage(file, &reason);
  if (image.empty()) throw InputError(file, reason, "Give an image, best a PNG, in image.mask.");
  if (image.channels() > 1) {
    cv::cvtColor(image, image, image.channels() == 3 ? cv::COLOR_BGR2GRAY : cv::COLOR_BGRA2GRAY);
  }
  const cv::Size prepared_size(camera_.width, camera_.height);
  if (image.size() != raw_size_ && image.size() != prepared_size) {
    throw InputError(
        file,
        fmt::format("has {} x {} px, the raw images have {} x {} px and the prepared ones {} x {} px",
                    image.cols, image.rows, raw_size_.width, raw_size_.height, prepared_size.width,
                    prepared_size.height),
        "Give a mask of one of these sizes.");
  }
  // Half of the brightest: masks come as 0 and 1, as 0 and 255, and with soft edges.
  double brightest = 0;
  cv::minMaxLoc(image, nullptr, &brightest);
  if (brightest == 0) {
    throw InputError(file, "is black, so that everything is ignored", "Paint white what is to be used.");
  }
  cv::Mat ignored = image < 0.5 * brightest;
  if (ignored.size() == raw_size_) {
    const cv::Mat cropped = ignored(crop_).clone();
    Resize(cropped, prepared_size, &ignored);
  }
  ignored = ignored > 0;  // also where a raw pixel is a part
  if (cv::countNonZero(ignored) == prepared_size.area()) {
    throw InputError(file, "ignores everything that the crop keeps", "Paint white what is to be used.");
  }
  return ignored;
}

std::string ImagePreparer::Refusal(const cv::Mat& raw) const {
  if (raw.size() != raw_size_) {
    return fmt::format("its size is {} x {} px, that of the camera {} x {} px", raw.cols, raw.rows,
                       raw_size_.width, raw_size_.height);
  }
  if (raw.depth() != CV_8U && raw.depth() != CV_16U) return "its pixels are neither of 8 nor of 16 bits";
  const int channels = raw.channels();
  if (channels != 1 && channels != 3 && channels != 4) return fmt::format("it has {} channels", channels);
  if (bayer_to_grey_ >= 0 && channels != 1) {
    return fmt::format("it has {} channels, but image.bayer is {}, for images with one", channels,
                       options_.bayer);
  }
  if (raw.depth() == CV_8U && options_.white_level > 255) {
    return fmt::format("its pixels are of 8 bits, but image.white_level is {}", options_.white_level);
  }
  return "";
}

void ImagePreparer::Prepare(const cv::Mat& raw, cv::Mat* grey) { Convert(raw, 1, grey); }

void ImagePreparer::PrepareColour(const cv::Mat& raw, cv::Mat* colour) { Convert(raw, 3, colour); }

void ImagePreparer::Convert(const cv::Mat& raw, int channels, cv::Mat* prepared) {
  if (const std::string refusal = Refusal(raw); !refusal.empty()) {
    throw InputError("image", refusal, "Check the camera and the options image.* against the images.");
  }
  cv::Mat image = raw(crop_);
  const bool is_grey = channels == 1;
  int code = -1;
  if (bayer_to_grey_ >= 0) {
    code = is_grey ? bayer_to_grey_ : bayer_to_colour_;
  } else if (image.channels() == 4) {
    code = is_grey ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGRA2BGR;
  } else if (image.channels() != channels) {
    code = is_grey ? cv::COLOR_BGR2GRAY : cv::COLOR_GRAY2BGR;
  }

  const cv::Size size(camera_.width, camera_.height);
  const double white = options_.white_level > 0  ? options_.white_level
                       : image.depth() == CV_16U ? std::numeric_limits<uint16_t>::max()
                                                 : std::numeric_limits<uint8_t>::max();
  if (code >= 0) {
    const bool is_all = image.size() == size && image.depth() == CV_8U && white == 255;
    cv::cvtColor(image, is_all ? *prepared : converted_, code);
    if (is_all) return;
    image = converted_;
  }
  if (image.size() == size) {
    image.convertTo(*prepared, CV_8U, 255 / white);  // a plain copy of 8 bits
  } else {
    if (image.depth() != CV_8U || white != 255) {
      image.convertTo(eight_bits_, CV_8U, 255 / white);
      image = eight_bits_;
    }
    Resize(image, size, prepared);
  }
}

cv::Mat ImagePreparer::MergedMask(const cv::Mat& mask) {
  DS_CHECK(
      mask.empty() || (mask.type() == CV_8UC1 && mask.cols == camera_.width && mask.rows == camera_.height),
      "mask {} x {} type {}, prepared image {} x {}", mask.cols, mask.rows, mask.type(), camera_.width,
      camera_.height);
  if (mask.empty()) return mask_;
  if (mask_.empty()) return mask;
  cv::bitwise_or(mask, mask_, merged_mask_);
  return merged_mask_;
}

}  // namespace dynamic_slam
