#include "dynamic_slam/io/camera_file.h"

#include <span>
#include <tuple>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/camera_import.h"
#include "dynamic_slam/io/flat_yaml.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

constexpr char kPinhole[] = "pinhole", kKannalaBrandt[] = "kannala_brandt";

// One list of a camera file's keys, for reading and writing; the coefficients are those of the camera's
// model.
struct CameraFields {
  Camera camera;
  std::string model;
  bool all_keys = false;  // those of the other model too

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    constexpr double kMinPx = Camera::kMinFocalPx, kMaxPx = Camera::kMaxFocalPx;
    auto& c = self.camera;
    visit("name", c.name, OptionField{"", 0, 0, ""});
    visit("model", self.model, OptionField{"", 0, 0, "pinhole or kannala_brandt (fisheye)."});
    visit("width", c.width, OptionField{"px", 1, Camera::kMaxSizePx, "Size of the raw image."});
    visit("height", c.height, OptionField{"px", 1, Camera::kMaxSizePx, ""});
    visit("fps", c.fps, OptionField{"Hz", 0, Camera::kMaxFps, "Frames per second; 0: unknown."});
    visit("fx", c.fx, OptionField{"px", kMinPx, kMaxPx, "Focal lengths."});
    visit("fy", c.fy, OptionField{"px", kMinPx, kMaxPx, ""});
    visit("cx", c.cx,
          OptionField{"px", 0, kMaxPx, "Principal point; (0, 0) is the centre of the top left pixel."});
    visit("cy", c.cy, OptionField{"px", 0, kMaxPx, ""});
    visit("readout_s", c.readout_s,
          OptionField{"s", 0, Camera::kMaxReadout_s,
                      "Rolling shutter: from the first row to the last; 0: all rows at once."});
    const bool is_fisheye = c.model == LensModel::kKannalaBrandt;
    visit("k1", c.k1,
          OptionField{"", 0, 0,
                      is_fisheye ? "Distortion of Kannala and Brandt, as in cv::fisheye."
                                 : "Radial (k) and tangential (p) distortion, as in OpenCV."});
    visit("k2", c.k2, OptionField{"", 0, 0, ""});
    if (!is_fisheye || self.all_keys) {
      visit("p1", c.p1, OptionField{"", 0, 0, ""});
      visit("p2", c.p2, OptionField{"", 0, 0, ""});
    }
    visit("k3", c.k3, OptionField{"", 0, 0, ""});
    if (is_fisheye || self.all_keys) visit("k4", c.k4, OptionField{"", 0, 0, ""});
  }
};

constexpr std::string_view kRequiredKeys[] = {"width", "height", "fx", "fy", "cx", "cy"};
constexpr std::string_view kRequiredFisheyeKeys[] = {"width", "height", "fx", "fy", "cx",
                                                     "cy",    "k1",     "k2", "k3", "k4"};

}  // namespace

Camera ReadCamera(const fs::path& file) {
  FlatYaml yaml(file);
  if (IsForeignCalibration(yaml)) {
    throw InputError(
        file.string(), "is the calibration file of another program",
        fmt::format("Make a camera file of it: dynamic_slam config --import-camera {}", file.string()));
  }
  const bool is_fisheye = yaml.Word("model") == kKannalaBrandt;
  CameraFields fields{Camera(), kPinhole, true};
  ReadYamlEntries(file, CollectOptions(fields),
                  is_fisheye ? std::span<const std::string_view>(kRequiredFisheyeKeys) : kRequiredKeys);
  if (fields.model != kPinhole && !is_fisheye) {
    const std::vector<std::string> known = {kPinhole, kKannalaBrandt};
    throw InputError(
        yaml.Where("model"), fmt::format("the model '{}' is not known", fields.model),
        fmt::format("Use model: pinhole, with k1 k2 p1 p2 k3 where the lens distorts, or, for a fisheye, "
                    "model: kannala_brandt, with k1 k2 k3 k4.{}",
                    DidYouMean(fields.model, known)));
  }
  for (const char* key : is_fisheye ? std::vector{"p1", "p2"} : std::vector{"k4"}) {
    if (!yaml.Has(key)) continue;
    yaml.AddProblem(key, fmt::format("{} is no coefficient of model: {}, but of model: {}", key, fields.model,
                                     is_fisheye ? kPinhole : kKannalaBrandt));
  }
  yaml.ThrowProblems("Correct the model, or leave the keys of the other one out.");
  fields.camera.model = is_fisheye ? LensModel::kKannalaBrandt : LensModel::kRadialTangential;
  if (fields.camera.name.empty()) fields.camera.name = file.stem().string();
  fields.camera.Validate();
  return fields.camera;
}

Camera LoadCamera(const std::string& name_or_path) {
  return ReadCamera(FindConfig("cameras", "camera", name_or_path));
}

std::vector<std::string> KnownCameras() { return ConfigNames("cameras"); }

Camera WithKnownLens(const Camera& camera, std::string_view family) {
  const auto numbers = [](const Camera& c) {
    return std::tuple(c.model, c.width, c.height, c.fx, c.fy, c.cx, c.cy);
  };
  if (camera.HasDistortion()) return camera;
  for (const std::string& name : KnownCameras()) {
    if (!name.starts_with(family)) continue;
    Camera known = LoadCamera(name);
    if (numbers(known) != numbers(camera)) continue;
    known.name = camera.name;
    known.fps = camera.fps;
    return known;
  }
  return camera;
}

std::string CameraToYaml(const Camera& camera) {
  return OptionsToYaml(
      CameraFields{camera, camera.model == LensModel::kKannalaBrandt ? kKannalaBrandt : kPinhole});
}

void WriteCamera(const fs::path& file, const Camera& camera) {
  WriteFileAtomically(file, CameraToYaml(camera));
}

void CheckCameraFits(const Camera& camera, const std::string& origin, const cv::Size& image_size) {
  if (camera.width == image_size.width && camera.height == image_size.height) return;
  throw InputError(
      fmt::format("{}: camera '{}'", origin, camera.name),
      fmt::format("is for images of {} x {} px, these have {} x {} px", camera.width, camera.height,
                  image_size.width, image_size.height),
      "Choose another --camera, or scale fx, fy, cx and cy to this size in a camera file of your own.");
}

}  // namespace dynamic_slam
