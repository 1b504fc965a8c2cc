#include "cmd_doctor.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <ceres/version.h>
#include <fmt/core.h>
#include <opencv2/core/utility.hpp>
#include <unistd.h>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/diagnosis/clip_advice.h"
#include "dynamic_slam/diagnosis/clip_measures.h"
#include "dynamic_slam/diagnosis/self_calibration.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/semantics/network_files.h"
#include "source_arguments.h"

namespace dynamic_slam {
namespace {

struct DoctorArguments {
  std::string source, camera, models;
  FrameSourceOptions source_options;
};

void Line(const std::string& what, const std::string& is) { fmt::print("{:<14} {}\n", what, is); }

// The value of the first line "key : value" of a file of /proc, or "unknown".
std::string FromProc(const char* file, const std::string& key) {
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    const size_t colon = line.find(':');
    if (colon != std::string::npos && Trim(line.substr(0, colon)) == key) {
      return std::string(Trim(line.substr(colon + 1)));
    }
  }
  return "unknown";
}

// Of those for which there is code of its own (base/dispatch.h).
std::string SimdPaths() {
#if defined(__x86_64__) && defined(__GNUC__)
  const auto word = [](bool is_there) { return is_there ? "yes" : "no"; };
  return fmt::format("AVX2 {}, POPCNT {}", word(__builtin_cpu_supports("avx2") != 0),
                     word(__builtin_cpu_supports("popcnt") != 0));
#else
  return "none, plain code is used";
#endif
}

void PrintMachine() {
  Line("program", "dynamic_slam " DYNAMIC_SLAM_VERSION);
  Line("libraries",
       fmt::format("OpenCV {}, Eigen {}.{}.{}, Ceres {}", cv::getVersionString(), EIGEN_WORLD_VERSION,
                   EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION, CERES_VERSION_STRING));
  Line("processor",
       fmt::format("{}, {} cores", FromProc("/proc/cpuinfo", "model name"), sysconf(_SC_NPROCESSORS_ONLN)));
  Line("SIMD", SimdPaths());
  Line("memory", FromProc("/proc/meminfo", "MemAvailable") + " free");
}

void PrintFiles(const std::string& models) {
  std::string devices;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/dev", ignored)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("video")) continue;
    const bool is_readable = access(entry.path().c_str(), R_OK | W_OK) == 0;
    devices += fmt::format("{}camera:{}{}", devices.empty() ? "" : ", ", name.substr(5),
                           is_readable ? "" : " (not readable for you: join the group video)");
  }
  Line("cameras here", devices.empty() ? "none" : devices);
  Line("camera files", fmt::format("{}", fmt::join(KnownCameras(), ", ")));
  for (const std::string& name : ConfigNames("detectors")) {
    const DetectorFile detector = ReadDetectorFile(FindConfig("detectors", "detector", name));
    std::string state = "ready";
    for (const NetworkFile& file : FindNetworkFiles(detector, ModelFolders(models))) {
      if (!file.found) {
        state = fmt::format("{} is missing (`dynamic_slam models {}` says where to get it)", file.wanted.file,
                            name);
      } else if (!file.WrongSha256().empty()) {
        state = fmt::format("{} is not the file expected: its SHA-256 differs", file.found->string());
      }
    }
    Line("detector", fmt::format("{:<18} {}", name, state));
  }
}

void PrintClip(const DoctorArguments& arguments) {
  const std::unique_ptr<FrameSource> source = OpenFrameSource(arguments.source, arguments.source_options);
  std::optional<Camera> camera = source->OwnCamera();
  if (!arguments.camera.empty()) camera = LoadCamera(arguments.camera);
  if (camera.has_value()) CheckCameraFits(*camera, arguments.camera, source->ImageSize());
  const ClipMeasures m = MeasureClip(camera, source.get());
  Line("clip", fmt::format("{} x {} px, {} images looked at", source->ImageSize().width,
                           source->ImageSize().height, m.images));
  Line("exposure", fmt::format("{:.0f} of 255 in the mean, {:.0f} % black, {:.0f} % white", m.grey,
                               100 * m.dark_share, 100 * m.bright_share));
  Line("blur",
       m.edge_width_px > 0 ? fmt::format("edges are {:.1f} px wide", m.edge_width_px) : "no strong edges");
  Line("texture", fmt::format("{:.0f} of {} keypoints", m.keypoints, ClipMeasures::kWantedKeypoints));
  Line("motion", fmt::format("{:.1f} % of the width in a third of a second", 100 * m.motion_share));
  Line("parallax", m.pairs == 0 ? "not measured: images with enough motion have too little in common"
                                : fmt::format("a rotation alone explains {:.0f} % of the matches of {} pairs",
                                              100 * m.rotation_share, m.pairs));
  // A map needs images that can be used.
  std::optional<SelfCalibration> calibration;
  if (camera.has_value() && AdviseOnClip(m).empty() && !source->IsLive()) {
    FrameSourceOptions few = arguments.source_options;
    constexpr int kImages = 300;
    few.max_frames = few.max_frames == 0 ? kImages : std::min(few.max_frames, kImages);
    calibration = CalibrateByMap(*camera, OpenFrameSource(arguments.source, few).get());
  }
  Line("calibration", !camera.has_value() ? "no camera is given (--camera)"
                      : !calibration.has_value()
                          ? "not measured: it needs a map of the clip"
                          : fmt::format("with another focal length, errors of a map are {:.0f} % smaller",
                                        100 * calibration->focal_gain));
  if (calibration.has_value()) {
    Line("shutter",
         fmt::format("with readout_s: {:.3f} instead of {:.3f}, errors of a map are {:.0f} % smaller",
                     calibration->readout_s, camera->readout_s, 100 * calibration->readout_gain));
    if (camera->model == LensModel::kRadialTangential) {
      Line("lens", fmt::format("with k1: {:.4f}, k2: {:.4f}, errors of a map are {:.1f} % smaller",
                               calibration->k1, calibration->k2, 100 * calibration->lens_gain));
    }
  }
  for (const SourceProblem& problem : source->Problems())
    Line("skipped", problem.name + ": " + problem.reason);
  const std::vector<ClipAdvice> advice = AdviseOnClip(m, calibration);
  if (advice.empty()) Line("advice", "Nothing stands in the way of a run.");
  for (const ClipAdvice& one : advice) Line("advice", one.text);
}

void RunDoctor(const DoctorArguments& arguments) {
  PrintMachine();
  PrintFiles(arguments.models);
  if (!arguments.source.empty()) PrintClip(arguments);
}

}  // namespace

void AddDoctorCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand("doctor", "Say whether machine, files and a clip are fit for a run");
  const auto arguments = std::make_shared<DoctorArguments>();
  DoctorArguments& a = *arguments;
  command->add_option("SOURCE", a.source, "Images that are looked at, as for run");
  command->add_option("--camera", a.camera,
                      "Name of a known camera, or camera file (default: what SOURCE says)");
  command->add_option("--models", a.models, "Folder in which network files are looked for too");
  AddSourceOptions(command, &a.source_options);
  command->footer("Example:\n  dynamic_slam doctor video.mp4 --camera my_camera.yaml");
  command->callback([arguments] { RunDoctor(*arguments); });
}

}  // namespace dynamic_slam
