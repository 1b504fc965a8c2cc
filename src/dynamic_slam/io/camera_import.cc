#include "dynamic_slam/io/camera_import.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <utility>
#include <vector>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

constexpr char kRemedy[] =
    "Correct the file, or write the numbers into a camera file by hand; README.md describes one.";

// A coefficient's name and the member that holds it.
using Coefficient = std::pair<const char*, double Camera::*>;
constexpr Coefficient kRadialTangential[] = {
    {"k1", &Camera::k1}, {"k2", &Camera::k2}, {"p1", &Camera::p1}, {"p2", &Camera::p2}};
constexpr Coefficient kKannalaBrandt[] = {
    {"k1", &Camera::k1}, {"k2", &Camera::k2}, {"k3", &Camera::k3}, {"k4", &Camera::k4}};

[[noreturn]] void RefuseModel(const FlatYaml& yaml, const std::string& key, const std::string& reason) {
  throw InputError(
      yaml.Where(key), reason,
      "Supported are pinholes, with radial-tangential or Kannala-Brandt (equidistant fisheye) distortion: "
      "calibrate the camera with one of these.");
}

std::string Lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

// A number of pixels: whole, and small enough for an image.
int SizePx(FlatYaml& yaml, const std::string& key, double number) {
  if (number == 0) return 0;  // a problem already, or one that Camera::Validate names
  if (number >= 1 && number <= 100000 && number == std::floor(number)) return static_cast<int>(number);
  yaml.AddProblem(key, fmt::format("{} must be a whole number from 1 to 100000 px, is {}", key, number));
  return 0;
}

void CheckGivenSize(FlatYaml& yaml, const std::string& key, const Camera& camera,
                    const std::optional<cv::Size>& image_size) {
  if (!image_size || camera.width == 0 || camera.height == 0) return;
  if (camera.width == image_size->width && camera.height == image_size->height) return;
  yaml.AddProblem(key, fmt::format("is for images of {} x {} px, not of {} x {} px", camera.width,
                                   camera.height, image_size->width, image_size->height));
}

// The coefficients below `prefix`, of the camera's model.
void ReadCoefficients(FlatYaml& yaml, const std::string& prefix, Camera* camera) {
  const bool is_fisheye = camera->model == LensModel::kKannalaBrandt;
  // All or none, as a misspelt one must not pass for zero.
  bool any = is_fisheye || yaml.Has(prefix + "k3");
  for (const auto& [name, unused] : kRadialTangential) any = any || yaml.Has(prefix + name);
  if (any) {
    for (const auto& [name, member] : is_fisheye ? kKannalaBrandt : kRadialTangential) {
      camera->*member = yaml.Number(prefix + name);
    }
  }
  if (!is_fisheye && yaml.Has(prefix + "k3")) camera->k3 = yaml.Number(prefix + "k3");
  const std::initializer_list<const char*> fisheye_foreign = {"p1", "p2", "k5", "k6"};
  const std::initializer_list<const char*> foreign = {"k4", "k5", "k6"};
  for (const char* name : is_fisheye ? fisheye_foreign : foreign) {
    if (!yaml.Has(prefix + name) || yaml.Number(prefix + name) == 0) continue;
    yaml.AddProblem(prefix + name, fmt::format("{}{} is no coefficient of the {} model", prefix, name,
                                               is_fisheye ? "Kannala-Brandt" : "radial-tangential"));
  }
}

// ORB-SLAM2 and 3, OpenVSLAM and stella_vslam.
Camera ReadCameraSection(FlatYaml& yaml, const std::optional<cv::Size>& image_size) {
  // OpenVSLAM's is Camera.model; ORB-SLAM2 has neither and knows pinholes only.
  const bool has_model = yaml.Has("Camera.model");
  const std::string model_key = has_model ? "Camera.model" : "Camera.type";
  const std::string model = Lower(yaml.Word(model_key));
  const bool is_fisheye = model == "fisheye" || model == "kannalabrandt8";
  const bool is_rectified = model == "rectified";
  if (model == "equirectangular") {
    RefuseModel(yaml, model_key,
                "equirectangular images are not supported: no pinhole sees the whole sphere");
  }
  const bool is_pinhole = model == "perspective" || model == "pinhole" || !yaml.Has(model_key);
  if (!is_fisheye && !is_rectified && !is_pinhole) {
    RefuseModel(yaml, model_key, fmt::format("the camera model '{}' is not supported", yaml.Word(model_key)));
  }
  if (yaml.HasSection("LEFT")) {
    throw InputError(
        yaml.file().string(),
        "Camera.fx and the like are of images that ORB-SLAM rectifies from a stereo pair, by LEFT.K",
        "Give the calibration of the left camera alone, as for a monocular run.");
  }

  const std::string prefix = yaml.HasSection("Camera1") ? "Camera1." : "Camera.";
  Camera camera;
  camera.name = yaml.Word("Camera.name");
  camera.model = is_fisheye ? LensModel::kKannalaBrandt : LensModel::kRadialTangential;
  camera.fx = yaml.Number(prefix + "fx");
  camera.fy = yaml.Number(prefix + "fy");
  camera.cx = yaml.Number(prefix + "cx");
  camera.cy = yaml.Number(prefix + "cy");
  if (yaml.Has("Camera.fps")) camera.fps = yaml.Number("Camera.fps");
  if (!is_rectified) ReadCoefficients(yaml, prefix, &camera);

  const std::string width = has_model ? "Camera.cols" : "Camera.width";
  const std::string height = has_model ? "Camera.rows" : "Camera.height";
  if (yaml.Has(width) || yaml.Has(height)) {
    camera.width = SizePx(yaml, width, yaml.Number(width));
    camera.height = SizePx(yaml, height, yaml.Number(height));
    CheckGivenSize(yaml, width, camera, image_size);
  } else if (image_size) {
    camera.width = image_size->width;
    camera.height = image_size->height;
  } else {
    yaml.AddProblem(
        width, fmt::format("the size of the images is missing: add the lines '{}: ...' and '{}: ...', in px",
                           width, height));
  }
  return camera;
}

// Kalibr and EuRoC; prefix: "cam0." or "".
Camera ReadChainCamera(FlatYaml& yaml, const std::string& prefix, const std::optional<cv::Size>& image_size) {
  const std::string model_key = prefix + "camera_model", distortion_key = prefix + "distortion_model";
  const std::string model = yaml.Word(model_key), distortion = yaml.Word(distortion_key);
  if (model != "pinhole") {
    RefuseModel(yaml, model_key, fmt::format("the camera model '{}' is not supported", model));
  }
  const bool is_fisheye = distortion == "equidistant", is_none = distortion == "none";
  if (!is_fisheye && !is_none && distortion != "radtan" && distortion != "radial-tangential") {
    RefuseModel(yaml, distortion_key, fmt::format("the distortion '{}' is not supported", distortion));
  }
  Camera camera;
  camera.model = is_fisheye ? LensModel::kKannalaBrandt : LensModel::kRadialTangential;
  const std::vector<double> size = yaml.Numbers(prefix + "resolution", 2);
  camera.width = SizePx(yaml, prefix + "resolution", size[0]);
  camera.height = SizePx(yaml, prefix + "resolution", size[1]);
  CheckGivenSize(yaml, prefix + "resolution", camera, image_size);
  const std::vector<double> intrinsics = yaml.Numbers(prefix + "intrinsics", 4);
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  if (yaml.Has(prefix + "rate_hz")) camera.fps = yaml.Number(prefix + "rate_hz");
  if (!is_none) {
    const std::string eurocs = prefix + "distortion_coefficients";
    const std::vector<double> k = yaml.Numbers(yaml.Has(eurocs) ? eurocs : prefix + "distortion_coeffs", 4);
    const auto& coefficients = is_fisheye ? kKannalaBrandt : kRadialTangential;
    for (size_t i = 0; i < k.size(); ++i) camera.*coefficients[i].second = k[i];
  }
  return camera;
}

}  // namespace

bool IsForeignCalibration(const FlatYaml& yaml) {
  return yaml.HasSection("Camera") || yaml.HasSection("Camera1") || yaml.HasSection("cam0") ||
         yaml.Has("camera_model");
}

Camera ImportCamera(const fs::path& file, const std::optional<cv::Size>& image_size) {
  FlatYaml yaml(file);
  if (!IsForeignCalibration(yaml)) {
    throw InputError(file.string(), "is no calibration of ORB-SLAM, OpenVSLAM, stella_vslam, Kalibr or EuRoC",
                     yaml.Has("fx")
                         ? "If it is a camera file, give it with --camera as it is."
                         : "Write the numbers into a camera file by hand; README.md describes one.");
  }
  Camera camera;
  if (yaml.HasSection("Camera") || yaml.HasSection("Camera1")) {
    camera = ReadCameraSection(yaml, image_size);
  } else {
    camera = ReadChainCamera(yaml, yaml.HasSection("cam0") ? "cam0." : "", image_size);
  }
  yaml.ThrowProblems(kRemedy);
  if (camera.name.empty()) camera.name = file.stem().string();
  try {
    camera.Validate();
  } catch (const InputError& e) {
    throw InputError(file.string(), e.what(), "");
  }
  return camera;
}

Camera ReadKittiCalibration(const fs::path& file, const cv::Size& image_size, double fps) {
  for (const TextLine& line : ReadDataLines(file)) {
    const std::vector<std::string_view> columns = SplitColumns(line.text);
    if (columns[0] != "P0:") continue;
    std::vector<double> p;
    for (size_t i = 1; i < columns.size(); ++i) p.push_back(ParseDouble(columns[i]).value_or(0));
    if (p.size() != 12) {
      throw InputError(fmt::format("{}:{}", file.string(), line.number),
                       fmt::format("P0 has {} numbers, 12 are wanted", p.size()),
                       "Correct the file, or give a camera file with --camera.");
    }
    Camera camera;
    camera.name = "calib.txt";
    camera.width = image_size.width;
    camera.height = image_size.height;
    camera.fps = fps;
    camera.fx = p[0];
    camera.cx = p[2];
    camera.fy = p[5];
    camera.cy = p[6];
    camera.Validate();
    return camera;
  }
  throw InputError(file.string(), "has no line 'P0:'",
                   "Correct the file, or give a camera file with --camera.");
}

}  // namespace dynamic_slam
