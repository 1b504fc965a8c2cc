#include "cmd_detect.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <unistd.h>

#include "compensated_detections.h"
#include "detection_report.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/stopwatch.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/eval/canvas.h"
#include "dynamic_slam/io/box_file.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/io/image_preparer.h"
#include "dynamic_slam/report/box_picture.h"
#include "run_console.h"
#include "source_arguments.h"

namespace dynamic_slam {
namespace {

struct DetectArguments {
  std::string source, detector, out, images, models, truth, out_compensated;
  std::string compensation = "none";
  double latency_ms = 0;
  int every = 1;
  FrameSourceOptions source_options{.any_size = true};
  bool quiet = false;
};

struct DetectRun {
  std::vector<BoxRecord> boxes, compensated;
  std::vector<double> stamps_s, times_ms;  // of each image
  bool interrupted = false;
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

std::string Label(const BoxRecord& box) { return fmt::format("{} {:.2f}", box.class_name, box.score); }

// The compensated boxes of a frame that the detector did not see are green, its own ones red.
void WriteAnnotated(const std::string& folder, size_t frame, cv::Mat image,
                    std::span<const BoxRecord> detected, std::span<const BoxRecord> filled_in) {
  for (const BoxRecord& box : filled_in) DrawBox(box.box, Label(box), kCompensatedColour, &image);
  for (const BoxRecord& box : detected) DrawBox(box.box, Label(box), kDetectedColour, &image);
  WritePicture(fmt::format("{}/{:06}.jpg", folder, frame), image);
}

// Detects, compensates and draws, image by image.
class DetectLoop {
 public:
  DetectLoop(const DetectArguments& arguments, FrameSource& source, Detector& detector)
      : arguments_(arguments), source_(source), detector_(detector), console_(true) {}

  DetectRun Run() {
    const bool show = !arguments_.quiet && isatty(STDERR_FILENO) != 0;
    size_t frame = 0;
    for (; const std::optional<SourceImage> raw = source_.Next(); ++frame) {
      run_.interrupted = console_.ShouldStop();
      if (run_.interrupted) break;
      if (frame % static_cast<size_t>(arguments_.every) != 0) continue;
      const size_t boxes_before = run_.boxes.size();
      Process(frame, *raw);
      if (show) {
        ShowProgress(frame + 1, source_.FrameCount(), run_.times_ms.back(), run_.boxes.size() - boxes_before);
      }
    }
    if (show) fmt::print(stderr, "\r\033[K");
    return std::move(run_);
  }

 private:
  void Process(size_t frame, const SourceImage& raw) {
    using Clock = std::chrono::steady_clock;
    if (size_ != raw.image.size()) Start(raw.image.size());
    preparer_->PrepareColour(raw.image, &image_);
    const FrameId id(static_cast<uint32_t>(frame));
    const Clock::time_point start = Clock::now();
    const std::vector<Detection> detections = detector_.Detect(image_, id, raw.timestamp_s);
    run_.times_ms.push_back(MillisecondsSince(start));
    run_.stamps_s.push_back(raw.timestamp_s);

    std::vector<BoxRecord> detected, filled_in;
    for (const Detection& d : detections)
      detected.push_back(Record(raw.timestamp_s, d.class_id, d.score, d.box));
    if (compensation_) {
      for (const CompensatedBox& c : compensation_->Update(id, raw.timestamp_s, image_, detections)) {
        run_.compensated.push_back(Record(raw.timestamp_s, c.class_id, c.score, c.box));
        if (!c.is_detected) filled_in.push_back(run_.compensated.back());
      }
    }
    if (!arguments_.images.empty()) WriteAnnotated(arguments_.images, frame, image_, detected, filled_in);
    run_.boxes.insert(run_.boxes.end(), detected.begin(), detected.end());
  }

  void Start(const cv::Size& size) {
    size_ = size;
    Camera camera = AnyCamera(size);
    if (const std::optional<Camera> own = source_.OwnCamera()) camera.fps = own->fps;
    if (arguments_.source_options.fps > 0) camera.fps = arguments_.source_options.fps;
    camera.fps = (camera.fps > 0 ? camera.fps : 30) / arguments_.every;
    preparer_.emplace(camera, ImageOptions());
    if (arguments_.compensation != "none") {
      compensation_.emplace(arguments_.compensation, camera, arguments_.latency_ms / 1000);
    }
  }

  BoxRecord Record(double timestamp_s, int class_id, double score, const Box& box) const {
    return {.timestamp_s = timestamp_s,
            .class_name = detector_.class_names()[static_cast<size_t>(class_id)],
            .score = score,
            .box = box};
  }

  const DetectArguments& arguments_;
  FrameSource& source_;
  Detector& detector_;
  RunConsole console_;
  DetectRun run_;
  cv::Size size_;
  cv::Mat image_;
  std::optional<ImagePreparer> preparer_;
  std::optional<CompensatedDetections> compensation_;
};

void PrintTimes(std::vector<double> times_ms) {
  if (times_ms.empty()) return;
  std::sort(times_ms.begin(), times_ms.end());
  const double count = static_cast<double>(times_ms.size());
  fmt::print("{:.1f} ms an image (median), {:.1f} ms (mean), {:.1f} ms at most\n",
             times_ms[times_ms.size() / 2], std::accumulate(times_ms.begin(), times_ms.end(), 0.0) / count,
             times_ms.back());
}

void CheckArguments(const DetectArguments& arguments) {
  if (arguments.compensation != "none") return;
  for (const auto& [option, is_given] : {std::pair("--out-compensated", !arguments.out_compensated.empty()),
                                         std::pair("--detector-latency-ms", arguments.latency_ms > 0)}) {
    if (is_given) throw InputError(option, "needs a compensation", "Add --compensation tracker, or paper.");
  }
}

void RunDetect(const DetectArguments& arguments, int* exit_code) {
  CheckArguments(arguments);
  const std::unique_ptr<Detector> detector = MakeDetector(arguments.detector, arguments.models);
  if (detector == nullptr) {
    throw InputError("--detector none", "detects nothing", fmt::format("Choose one of: {}.", DetectorHelp()));
  }
  for (const std::string& warning : detector->warnings()) fmt::print(stderr, "warning: {}\n", warning);
  const std::unique_ptr<FrameSource> source = OpenFrameSource(arguments.source, arguments.source_options);
  std::vector<BoxRecord> truth;
  if (!arguments.truth.empty()) truth = ReadBoxFile(arguments.truth);
  CheckCanBeWritten(arguments.out);
  if (!arguments.out_compensated.empty()) CheckCanBeWritten(arguments.out_compensated);
  if (!arguments.images.empty()) CheckCanBeWritten(std::filesystem::path(arguments.images) / "000000.jpg");

  const DetectRun run = DetectLoop(arguments, *source, *detector).Run();
  WriteBoxFile(arguments.out, run.boxes);
  fmt::print("{}: {} boxes in {} images\n", arguments.out, run.boxes.size(), run.times_ms.size());
  if (!arguments.out_compensated.empty()) {
    WriteBoxFile(arguments.out_compensated, run.compensated);
    fmt::print("{}: {} boxes\n", arguments.out_compensated, run.compensated.size());
  }
  for (const SourceProblem& problem : source->Problems())
    fmt::print("skipped {}: {}\n", problem.name, problem.reason);
  PrintTimes(run.times_ms);
  if (!arguments.truth.empty()) {
    PrintDetectionReport(truth, run.stamps_s, run.boxes, arguments.compensation, run.compensated);
  }
  if (run.interrupted) *exit_code = kExitInterrupted;
}

}  // namespace

void AddDetectCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand("detect", "Find the objects in each image of a sequence");
  const auto arguments = std::make_shared<DetectArguments>();
  DetectArguments& a = *arguments;
  command->add_option("SOURCE", a.source, "As of run; images of a folder may differ in size")->required();
  command->add_option("--detector", a.detector, DetectorHelp())->required();
  command->add_option("--out", a.out, "File for the boxes: timestamp,class,score,x,y,w,h")->required();
  command->add_option("--images", a.images, "Folder for the images with their boxes");
  command->add_option("--truth", a.truth, "True boxes: prints recall, precision and miss rate of persons");
  command->add_option("--compensation", a.compensation, "Fills in boxes that the detector misses")
      ->check(CLI::IsMember(CompensationOptions::kMethods))
      ->capture_default_str();
  command->add_option("--out-compensated", a.out_compensated, "File for the boxes after compensation");
  command
      ->add_option("--detector-latency-ms", a.latency_ms,
                   "Compensation asks about one image at a time and gets each answer so much later")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--models", a.models, "Folder in which network files are looked for too");
  command->add_option("--every", a.every, "Only each n-th image")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  AddSourceOptions(command, &a.source_options);
  command->add_flag("--quiet", a.quiet, "No progress line");
  command->footer(
      "Examples:\n"
      "  dynamic_slam detect holiday_photos --detector hog --out boxes.csv --images annotated\n"
      "  dynamic_slam detect video.mp4 --detector yolox_nano --models ~/networks --out boxes.csv\n"
      "  dynamic_slam detect SOURCE --detector yolox_nano --compensation tracker --truth SOURCE/boxes.csv "
      "--out boxes.csv");
  command->callback([arguments, exit_code] { RunDetect(*arguments, exit_code); });
}

}  // namespace dynamic_slam
