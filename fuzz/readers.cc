#include "readers.h"

#include <cmath>
#include <fstream>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/eval/scale_source.h"
#include "dynamic_slam/io/box_file.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/camera_import.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/io/fault_injection.h"
#include "dynamic_slam/io/image_file.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/semantics/detector_file.h"
#include "dynamic_slam/semantics/dynamic_prior.h"
#include "dynamic_slam/sim/simulation.h"
#include "dynamic_slam/system/system_options.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

// The same camera when it is written and read again, and finite pixels all over the image.
void CheckCamera(const Camera& camera, const fs::path& folder) {
  const std::string text = CameraToYaml(camera);
  const std::string again = CameraToYaml(ReadCamera(Put(folder / "again.yaml", text)));
  DS_CHECK(again == text, "{}\n{}", text, again);
  for (const double bound : camera.IdealBounds()) DS_CHECK(std::isfinite(bound), "{}", text);
  for (const double x : {0.0, 0.5, 1.0}) {
    for (const double y : {0.0, 0.5, 1.0}) {
      const Eigen::Vector2d px(x * (camera.width - 1), y * (camera.height - 1));
      DS_CHECK(camera.Undistort(px).allFinite() && camera.Distort(px).allFinite(), "{} at {}, {}", text, x,
               y);
    }
  }
}

void ReadCameraFile(std::string_view bytes, const fs::path& folder) {
  const fs::path file = Put(folder / "camera.yaml", bytes);
  Camera camera;
  if (IsTaken(file.string(), [&] { camera = ReadCamera(file); })) CheckCamera(camera, folder);
}

void ReadCalibration(std::string_view bytes, const fs::path& folder) {
  const fs::path file = Put(folder / "calibration", bytes);
  Camera camera;
  const auto check = [&](const std::function<void()>& read) {
    if (IsTaken(file.string(), read)) CheckCamera(camera, folder);
  };
  check([&] { camera = ImportCamera(file); });
  check([&] { camera = ImportCamera(file, cv::Size(640, 480)); });
  check([&] { camera = ReadKittiCalibration(file, cv::Size(1241, 376), 10); });
}

// Values within their ranges, and the same when they are written and read again.
template <class Options>
void ReadOptionsFile(std::string_view bytes, const fs::path& folder) {
  const fs::path file = Put(folder / "options.yaml", bytes);
  Options options;
  if (!IsTaken(file.string(), [&] { LoadOptions(file, &options); })) {
    DS_CHECK(OptionsToYaml(options) == OptionsToYaml(Options()), "refused, and taken in part");
    return;
  }
  CheckOptions(options);
  const std::string text = OptionsToYaml(options);
  Options again;
  LoadOptions(Put(folder / "again.yaml", text), &again);
  DS_CHECK(OptionsToYaml(again) == text, "{}", text);
}

void ReadWords(std::string_view bytes, const fs::path&) {
  const std::string text(bytes);
  IsTaken("--inject", [&] { ParseFaults(text, "--inject"); });
  IsTaken("--scale-from", [&] { ParseScaleSource(text); });
  SystemOptions options;
  if (IsTaken("--set", [&] { ApplySet(&options, text); })) CheckOptions(options);
}

void ReadDetector(std::string_view bytes, const fs::path& folder) {
  const fs::path file = Put(folder / "detector.yaml", bytes);
  IsTaken(folder.string(), [&] {  // or the file of its classes
    const DetectorFile detector = ReadDetectorFile(file);
    DS_CHECK(!detector.class_names.empty(), "");
    CheckOptions(detector.options);
  });
}

void ReadPrior(std::string_view bytes, const fs::path& folder) {
  const fs::path file = Put(folder / "prior.yaml", bytes);
  IsTaken(file.string(), [&] {
    const DynamicPrior prior = ReadDynamicPrior(file);
    for (const auto& [name, score] : prior.score_of_class)
      DS_CHECK(score >= 0 && score <= 10, "{} {}", name, score);
  });
}

void ReadTrajectories(std::string_view bytes, const fs::path& folder) {
  const fs::path file = Put(folder / "trajectory.txt", bytes);
  const auto check = [&](const Trajectory& trajectory) {
    double last_s = -std::numeric_limits<double>::infinity();
    for (const StampedPose& pose : trajectory) {
      DS_CHECK(pose.timestamp_s >= last_s, "{} after {}", pose.timestamp_s, last_s);
      last_s = pose.timestamp_s;
      DS_CHECK(pose.world_from_cam.translation.allFinite(), "");
      DS_CHECK(std::abs(pose.world_from_cam.rotation.norm() - 1) < 1e-9, "");
    }
  };
  IsTaken(file.string(), [&] { check(ReadTumTrajectory(file)); });
  IsTaken(file.string(), [&] {
    for (const Rigid3& pose : ReadKittiPoses(file)) DS_CHECK(std::abs(pose.rotation.norm() - 1) < 1e-9, "");
  });
  IsTaken(file.string(), [&] { ReadTimes(file); });
  Put(folder / "times.txt", "0\n1\n2\n3\n");
  IsTaken(file.string(), [&] { check(ReadGroundTruth(file, folder)); });
}

void ReadBoxes(std::string_view bytes, const fs::path& folder) {
  const fs::path file = Put(folder / "boxes.csv", bytes);
  std::vector<BoxRecord> records;
  if (!IsTaken(file.string(), [&] { records = ReadBoxFile(file); })) return;
  const fs::path again = folder / "again.csv";
  WriteBoxFile(again, records);
  DS_CHECK(ReadBoxFile(again).size() == records.size(), "{}", records.size());
  const auto detector = MakeDetector("boxes:" + file.string());
  const cv::Mat image(48, 64, CV_8UC1, cv::Scalar(0));
  for (const BoxRecord& record : records) {
    for (const Detection& detection : detector->Detect(image, FrameId(0), record.timestamp_s)) {
      DS_CHECK(detection.box.x >= 0 && detection.box.x + detection.box.width <= 64, "");
    }
  }
}

void ReadImageBytes(std::string_view bytes, const fs::path&) { IsTruncatedImage(std::string(bytes)); }

}  // namespace

fs::path Put(const fs::path& file, std::string_view bytes) {
  std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return file;
}

bool IsTaken(std::string_view name, const std::function<void()>& call) {
  try {
    call();
    return true;
  } catch (const InputError& error) {
    const std::string_view text = error.what();
    // Cameras are validated under their own name, which their file says.
    DS_CHECK(text.starts_with(name) || text.starts_with("camera '"), "'{}' does not begin with {}", text,
             name);
    DS_CHECK(text.size() > name.size() + 4, "'{}' says no reason", text);
    return false;
  }
}

std::span<const Reader> Readers() {
  static constexpr Reader kReaders[] = {
      {"boxes", ReadBoxes},
      {"calibration", ReadCalibration},
      {"camera", ReadCameraFile},
      {"detector", ReadDetector},
      {"euroc", ReadEurocSequence},
      {"image", ReadImageBytes},
      {"journal", ReadRunJournal},
      {"kitti", ReadKittiSequence},
      {"map", ReadMapBytes},
      {"options", ReadOptionsFile<SystemOptions>},
      {"prior", ReadPrior},
      {"scene", ReadOptionsFile<SceneOptions>},
      {"trajectory", ReadTrajectories},
      {"tum", ReadTumSequence},
      {"words", ReadWords},
#ifdef DYNAMIC_SLAM_HAS_VIEWER
      {"viewer_command", ReadViewerCommand},
      {"viewer_recording", ReadViewerRecording},
      {"viewer_request", ReadViewerRequest},
#endif
  };
  return kReaders;
}

}  // namespace dynamic_slam
