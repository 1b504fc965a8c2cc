#include "cmd_detect.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <unistd.h>

#include "box_picture.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/eval/canvas.h"
#include "dynamic_slam/io/box_file.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/io/image_preparer.h"

namespace dynamic_slam {
namespace {

struct DetectArguments {
  std::string source, detector, out, images, models;
  int every = 1;
  FrameSourceOptions source_options{.any_size = true};
  bool quiet = false;
};

struct DetectRun {
  std::vector<BoxRecord> boxes;
  std::vector<double> times_ms;  // of each image
};

// Detection needs no camera: one that fits images of this size.
Camera AnyCamera(const cv::Size& size) {
  Camera camera;
  camera.width = size.width;
  camera.height = size.height;
  camera.fx = camera.fy = size.width;
  camera.cx = 0.5 * (size.width - 1);
  camera.cy = 0.5 * (size.height - 1);
  return camera;
}

// The line that is written over while it goes on; on a terminal only.
void ShowProgress(size_t frame, size_t frames_total, double time_ms, size_t boxes) {
  const std::string total = frames_total > 0 ? fmt::format("/{}", frames_total) : "";
  fmt::print(stderr, "\r\033[Kframe {}{}  {:.0f} ms  {} boxes", frame, total, time_ms, boxes);
  std::fflush(stderr);
}

void WriteAnnotated(const std::string& folder, size_t frame, cv::Mat image,
                    const std::vector<BoxRecord>& boxes) {
  for (const BoxRecord& box : boxes) {
    DrawBox(box.box, fmt::format("{} {:.2f}", box.class_name, box.score), kDetectedColour, &image);
  }
  WritePicture(fmt::format("{}/{:06}.jpg", folder, frame), image);
}

DetectRun DetectAll(const DetectArguments& arguments, FrameSource& source, Detector& detector) {
  using Clock = std::chrono::steady_clock;
  const bool show = !arguments.quiet && isatty(STDERR_FILENO) != 0;
  DetectRun run;
  std::optional<ImagePreparer> preparer;
  cv::Size size;
  cv::Mat image;
  size_t frame = 0;
  for (; const std::optional<SourceImage> raw = source.Next(); ++frame) {
    if (frame % static_cast<size_t>(arguments.every) != 0) continue;
    if (size != raw->image.size()) {
      size = raw->image.size();
      preparer.emplace(AnyCamera(size), ImageOptions());
    }
    preparer->PrepareColour(raw->image, &image);
    const Clock::time_point start = Clock::now();
    const std::vector<Detection> detections =
        detector.Detect(image, FrameId(static_cast<uint32_t>(frame)), raw->timestamp_s);
    run.times_ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
    std::vector<BoxRecord> boxes;
    for (const Detection& detection : detections) {
      boxes.push_back({.timestamp_s = raw->timestamp_s,
                       .class_name = detector.class_names()[static_cast<size_t>(detection.class_id)],
                       .score = detection.score,
                       .box = detection.box});
    }
    if (show) ShowProgress(frame + 1, source.FrameCount(), run.times_ms.back(), boxes.size());
    if (!arguments.images.empty()) WriteAnnotated(arguments.images, frame, image, boxes);
    run.boxes.insert(run.boxes.end(), boxes.begin(), boxes.end());
  }
  if (show) fmt::print(stderr, "\r\033[K");
  return run;
}

void PrintTimes(std::vector<double> times_ms) {
  std::sort(times_ms.begin(), times_ms.end());
  const double count = static_cast<double>(times_ms.size());
  fmt::print("{:.1f} ms an image (median), {:.1f} ms (mean), {:.1f} ms at most\n",
             times_ms[times_ms.size() / 2], std::accumulate(times_ms.begin(), times_ms.end(), 0.0) / count,
             times_ms.back());
}

void RunDetect(const DetectArguments& arguments) {
  const std::unique_ptr<Detector> detector = MakeDetector(arguments.detector, arguments.models);
  if (detector == nullptr) {
    throw InputError("--detector none", "detects nothing", fmt::format("Choose one of: {}.", DetectorHelp()));
  }
  for (const std::string& warning : detector->warnings()) fmt::print(stderr, "warning: {}\n", warning);
  const std::unique_ptr<FrameSource> source = OpenFrameSource(arguments.source, arguments.source_options);
  CheckCanBeWritten(arguments.out);
  if (!arguments.images.empty()) CheckCanBeWritten(std::filesystem::path(arguments.images) / "000000.jpg");
  const DetectRun run = DetectAll(arguments, *source, *detector);
  // Compensation and the comparison with the truth belong here, over run.boxes.
  WriteBoxFile(arguments.out, run.boxes);
  fmt::print("{}: {} boxes in {} images\n", arguments.out, run.boxes.size(), run.times_ms.size());
  for (const SourceProblem& problem : source->Problems())
    fmt::print("skipped {}: {}\n", problem.name, problem.reason);
  PrintTimes(run.times_ms);
}

}  // namespace

void AddDetectCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand("detect", "Find the objects in each image of a sequence");
  const auto arguments = std::make_shared<DetectArguments>();
  DetectArguments& a = *arguments;
  command->add_option("SOURCE", a.source, "As of run; images of a folder may differ in size")->required();
  command->add_option("--detector", a.detector, DetectorHelp())->required();
  command->add_option("--out", a.out, "File for the boxes: timestamp,class,score,x,y,w,h")->required();
  command->add_option("--images", a.images, "Folder for the images with their boxes");
  command->add_option("--models", a.models, "Folder in which network files are looked for too");
  command->add_option("--every", a.every, "Only each n-th image")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--start", a.source_options.start, "Frames to skip first")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--max-frames", a.source_options.max_frames, "Frames to read at most (0: all)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--fps", a.source_options.fps, "Frames a second of a folder of images (30) or a video")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--quiet", a.quiet, "No progress line");
  command->footer(
      "Examples:\n"
      "  dynamic_slam detect holiday_photos --detector hog --out boxes.csv --images annotated\n"
      "  dynamic_slam detect video.mp4 --detector yolox_nano --models ~/networks --out boxes.csv");
  command->callback([arguments] { RunDetect(*arguments); });
}

}  // namespace dynamic_slam
