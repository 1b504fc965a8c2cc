#include "dynamic_slam/io/camera_file.h"

#include <algorithm>
#include <cstdlib>
#include <limits>

#include <yaml-cpp/yaml.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

// One list of a camera file's keys, for reading and writing.
struct CameraFields {
  Camera camera;
  std::string model = "pinhole";

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    constexpr double kMaxPx = 1e6;
    auto& c = self.camera;
    visit("name", c.name, OptionField{"", 0, 0, ""});
    visit("model", self.model, OptionField{"", 0, 0, "Only pinhole."});
    visit("width", c.width, OptionField{"px", 1, 100000, "Size of the raw image."});
    visit("height", c.height, OptionField{"px", 1, 100000, ""});
    visit("fps", c.fps, OptionField{"Hz", 0, 1e5, "Frames per second; 0: unknown."});
    visit("fx", c.fx, OptionField{"px", 1e-3, kMaxPx, "Focal lengths."});
    visit("fy", c.fy, OptionField{"px", 1e-3, kMaxPx, ""});
    visit("cx", c.cx,
          OptionField{"px", 0, kMaxPx, "Principal point; (0, 0) is the centre of the top left pixel."});
    visit("cy", c.cy, OptionField{"px", 0, kMaxPx, ""});
    visit("k1", c.k1, OptionField{"", 0, 0, "Radial (k) and tangential (p) distortion, as in OpenCV."});
    visit("k2", c.k2, OptionField{"", 0, 0, ""});
    visit("p1", c.p1, OptionField{"", 0, 0, ""});
    visit("p2", c.p2, OptionField{"", 0, 0, ""});
    visit("k3", c.k3, OptionField{"", 0, 0, ""});
  }
};

constexpr std::string_view kRequiredKeys[] = {"width", "height", "fx", "fy", "cx", "cy"};

// Where camera files are looked for, best first.
std::vector<fs::path> CameraFolders() {
  std::vector<fs::path> folders;
  if (const char* config = std::getenv("DYNAMIC_SLAM_CONFIG"); config != nullptr && *config != '\0') {
    folders.push_back(fs::path(config) / "cameras");
  }
  folders.push_back(fs::path(DYNAMIC_SLAM_SOURCE_CONFIG) / "cameras");
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (!error) folders.push_back(program.parent_path().parent_path() / "share/dynamic_slam/config/cameras");
  return folders;
}

// Columns of "[a, b, c]" below `key`.
std::vector<double> Numbers(const fs::path& file, const YAML::Node& root, const std::string& key,
                            size_t count) {
  const YAML::Node node = root[key];
  std::vector<double> numbers;
  if (node && node.IsSequence()) {
    for (const auto& item : node) {
      const auto number = item.IsScalar() ? ParseDouble(item.Scalar()) : std::nullopt;
      if (number) numbers.push_back(*number);
    }
  }
  if (numbers.size() != count) {
    const std::string where =
        node ? fmt::format("{}:{}", file.string(), node.Mark().line + 1) : file.string();
    throw InputError(where, fmt::format("'{}' with {} numbers is wanted", key, count),
                     "Correct the file, or give a camera file with --camera.");
  }
  return numbers;
}

}  // namespace

Camera ReadCamera(const fs::path& file) {
  CameraFields fields;
  ReadYamlEntries(file, CollectOptions(fields), kRequiredKeys);
  if (fields.model != "pinhole") {
    throw InputError(file.string(), fmt::format("the model '{}' is not known", fields.model),
                     "Use model: pinhole, with k1 k2 p1 p2 k3 where the lens distorts.");
  }
  if (fields.camera.name.empty()) fields.camera.name = file.stem().string();
  fields.camera.Validate();
  return fields.camera;
}

Camera LoadCamera(const std::string& name_or_path) {
  const fs::path path(name_or_path);
  std::error_code ignored;
  if (fs::is_regular_file(path, ignored)) return ReadCamera(path);
  const bool is_name = !path.has_parent_path() && path.extension() != ".yaml" && path.extension() != ".yml";
  if (is_name && !name_or_path.empty()) {
    for (const fs::path& folder : CameraFolders()) {
      const fs::path file = folder / (name_or_path + ".yaml");
      if (fs::is_regular_file(file, ignored)) return ReadCamera(file);
    }
  }
  const std::vector<std::string> known = KnownCameras();
  throw InputError(
      fmt::format("camera '{}'", name_or_path),
      is_name ? "is neither a file nor a known name" : "there is no such file",
      fmt::format("Known names: {}.{}", fmt::join(known, ", "), DidYouMean(name_or_path, known)));
}

std::vector<std::string> KnownCameras() {
  std::vector<std::string> names;
  for (const fs::path& folder : CameraFolders()) {
    std::error_code ignored;
    for (const auto& item : fs::directory_iterator(folder, ignored)) {
      if (item.path().extension() == ".yaml") names.push_back(item.path().stem().string());
    }
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

void WriteCamera(const fs::path& file, const Camera& camera) {
  CameraFields fields;
  fields.camera = camera;
  WriteFileAtomically(file, EntriesToYaml(CollectOptions(fields)));
}

void CheckCameraFits(const Camera& camera, const std::string& origin, const cv::Size& image_size) {
  if (camera.width == image_size.width && camera.height == image_size.height) return;
  throw InputError(
      fmt::format("{}: camera '{}'", origin, camera.name),
      fmt::format("is for images of {} x {} px, these have {} x {} px", camera.width, camera.height,
                  image_size.width, image_size.height),
      "Choose another --camera, or scale fx, fy, cx and cy to this size in a camera file of your own.");
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

Camera ReadEurocSensor(const fs::path& file) {
  std::string text = ReadFile(file);
  // OpenCV writes "%YAML:1.0", which is no YAML directive.
  if (text.starts_with("%YAML:")) text[0] = '#';
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::ParserException& e) {
    throw InputError(fmt::format("{}:{}", file.string(), e.mark.line + 1),
                     fmt::format("is not YAML: {}", e.msg), "");
  }
  if (!root.IsMap()) throw InputError(file.string(), "'key: value' lines are wanted", "");
  const auto word = [&root](const char* key) {
    const YAML::Node node = root[key];
    return node && node.IsScalar() ? node.Scalar() : std::string();
  };
  const std::string model = word("camera_model"), distortion = word("distortion_model");
  if (model != "pinhole" ||
      (distortion != "radial-tangential" && distortion != "radtan" && distortion != "none")) {
    throw InputError(
        file.string(),
        fmt::format("camera model '{}' with distortion '{}' is not supported", model, distortion),
        "Only pinhole with radial-tangential distortion is: undistort the images to that first.");
  }
  Camera camera;
  camera.name = "sensor.yaml";
  const std::vector<double> size = Numbers(file, root, "resolution", 2);
  const std::vector<double> intrinsics = Numbers(file, root, "intrinsics", 4);
  camera.width = static_cast<int>(size[0]);
  camera.height = static_cast<int>(size[1]);
  camera.fps = ParseDouble(word("rate_hz")).value_or(0);
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  if (distortion != "none") {
    const std::vector<double> k = Numbers(file, root, "distortion_coefficients", 4);
    camera.k1 = k[0];
    camera.k2 = k[1];
    camera.p1 = k[2];
    camera.p2 = k[3];
  }
  camera.Validate();
  return camera;
}

}  // namespace dynamic_slam
