// Time of tracking and mapping on a sequence, in multiples of "one ORB": the median time of OpenCV's ORB with
// 1,000 features on the same images, in the same process. Absolute times do not transfer between machines;
// the ratios do, roughly. bench/README.md says how to read them.

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <unistd.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/io/image_preparer.h"
#include "dynamic_slam/system/sequence_runner.h"
#include "dynamic_slam/system/slam_system.h"

namespace dynamic_slam {
namespace {

constexpr int kOrbFeatures = 1000;
constexpr int kOrbFrameStep = 2;  // every second frame is enough for a median

// What a frame costs because something may move in it: boxes over time, how keypoints move in and around
// them, and what that says of keypoints and objects.
constexpr std::string_view kSemanticScopes[] = {"detection/collect", "detection/rotation", "tracking/flow",
                                                "tracking/judge",    "tracking/watch",     "tracking/seeds"};

struct BenchArguments {
  std::string source;
  std::string camera;
  std::string detector = "none";
  std::vector<std::string> assignments;
  bool is_realtime = false;
  bool json = false;
};

// Wall time, as tracking_ms is; without decoding the images and making them grey.
std::vector<double> TimeOpenCvOrb(const std::string& source, const Camera& camera) {
  ImagePreparer preparer(camera, {});
  cv::Mat grey;
  const std::unique_ptr<FrameSource> frames = OpenFrameSource(source);
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(kOrbFeatures, 1.2f, 8);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  std::vector<double> times_ms;
  for (int i = 0;; ++i) {
    const std::optional<SourceImage> image = frames->Next();
    if (!image.has_value()) return times_ms;
    if (i % kOrbFrameStep != 0) continue;
    preparer.Prepare(image->image, &grey);
    const auto start = std::chrono::steady_clock::now();
    orb->detectAndCompute(grey, cv::noArray(), keypoints, descriptors);
    times_ms.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
}

// Of the frames that were looked for in the map, by the events of a trace: those of a frame end before it
// does.
std::vector<double> SemanticTimes(const nlohmann::json& trace) {
  std::vector<double> times_ms;
  double semantic_ms = 0;
  bool has_map = false;
  for (const nlohmann::json& event : trace.at("traceEvents")) {
    if (event.at("ph") != "X") continue;
    const std::string_view name = event.at("name").get_ref<const std::string&>();
    if (std::ranges::find(kSemanticScopes, name) != std::end(kSemanticScopes)) {
      semantic_ms += 1e-3 * event.at("dur").get<double>();
    } else if (name == "tracking/local map") {
      has_map = true;
    } else if (name == "frame") {
      if (has_map) times_ms.push_back(semantic_ms);
      semantic_ms = 0;
      has_map = false;
    }
  }
  return times_ms;
}

// Ends the trace; it is in no file after that.
nlohmann::json TakeTrace() {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / fmt::format("dynamic_slam_track_bench.{}.json", getpid());
  WriteTrace(file);
  const nlohmann::json trace = nlohmann::json::parse(std::ifstream(file));
  std::filesystem::remove(file);
  return trace;
}

Camera ChooseCamera(const BenchArguments& arguments, const FrameSource& source) {
  if (!arguments.camera.empty()) return LoadCamera(arguments.camera);
  const std::optional<Camera> own = source.OwnCamera();
  if (!own.has_value()) {
    throw InputError(arguments.source, "has no camera file of its own",
                     "Give one with --camera NAME or FILE.");
  }
  return *own;
}

nlohmann::ordered_json ToJson(const TimeStatistics& times, double one_orb_ms) {
  return {{"median", times.median},
          {"mean", times.mean},
          {"p95", times.p95},
          {"max", times.max},
          {"p95_over_median", times.p95 / times.median},
          {"median_over_orb", times.median / one_orb_ms}};
}

void Print(const char* name, const TimeStatistics& times, double one_orb_ms) {
  fmt::print("{:<22}{:8.2f} {:8.2f} {:8.2f} {:8.2f} {:10.2f}\n", name, times.median, times.mean, times.p95,
             times.max, times.median / one_orb_ms);
}

void RunBench(const BenchArguments& arguments) {
  cv::setNumThreads(1);
  SystemOptions options;
  options.orb.features = kOrbFeatures;
  options.orb.threads = 1;
  ApplySet(&options, arguments.assignments);
  const std::unique_ptr<FrameSource> source = OpenFrameSource(arguments.source);
  const Camera camera = ChooseCamera(arguments, *source);
  CheckCameraFits(camera, arguments.source, source->ImageSize());

  // Before and after the run, so that a machine that gets slower meanwhile slows both sides of the ratio.
  std::vector<double> orb_ms = TimeOpenCvOrb(arguments.source, camera);
  const double orb_before_ms = SummariseTimes(orb_ms).median;
  SlamSystem system(camera, options, arguments.is_realtime ? RunMode::kRealtime : RunMode::kOffline);
  system.SetDetector(MakeDetector(arguments.detector));
  StartTrace();
  const RunSummary summary = RunSequence(*source, system);
  const TimeStatistics semantic = SummariseTimes(SemanticTimes(TakeTrace()));
  const std::vector<double> after_ms = TimeOpenCvOrb(arguments.source, camera);
  const double orb_after_ms = SummariseTimes(after_ms).median;
  orb_ms.insert(orb_ms.end(), after_ms.begin(), after_ms.end());
  const TimeStatistics orb = SummariseTimes(orb_ms);
  const double one_orb_ms = orb.median;

  if (arguments.json) {
    const nlohmann::ordered_json json = {{"frames_total", summary.frames_total},
                                         {"frames_tracked", summary.frames_tracked},
                                         {"keyframes", summary.keyframes},
                                         {"landmarks", summary.landmarks},
                                         {"features", options.orb.features},
                                         {"peak_rss_mb", summary.peak_rss_mb},
                                         {"one_orb_ms", one_orb_ms},
                                         {"one_orb_before_ms", orb_before_ms},
                                         {"one_orb_after_ms", orb_after_ms},
                                         {"tracking_ms", ToJson(summary.tracking_ms, one_orb_ms)},
                                         {"semantic_ms", ToJson(semantic, one_orb_ms)},
                                         {"mapping_ms", ToJson(summary.mapping_ms, one_orb_ms)}};
    fmt::print("{}\n", json.dump(2));
    return;
  }
  fmt::print("{} of {} frames tracked, {} keyframes, {} landmarks, {} features\n", summary.frames_tracked,
             summary.frames_total, summary.keyframes, summary.landmarks, options.orb.features);
  fmt::print("{:<22}{:>8} {:>8} {:>8} {:>8} {:>10}\n", "ms", "median", "mean", "p95", "max", "over ORB");
  Print("one ORB (OpenCV)", orb, one_orb_ms);
  Print("tracking a frame", summary.tracking_ms, one_orb_ms);
  Print("of it, for what moves", semantic, one_orb_ms);
  Print("mapping a keyframe", summary.mapping_ms, one_orb_ms);
  fmt::print("one ORB before the run {:.2f} ms, after it {:.2f} ms; at most {:.0f} MB of memory\n",
             orb_before_ms, orb_after_ms, summary.peak_rss_mb);
}

int Main(int argc, char** argv) {
  BenchArguments arguments;
  if (const char* data = std::getenv("DYNAMIC_SLAM_DATA")) {
    arguments.source = (std::filesystem::path(data) / "tum_fr1_desk").string();
    arguments.camera = "tum_fr1";
  }
  const std::string default_source = arguments.source;
  CLI::App app{"Time of tracking and mapping, in multiples of OpenCV's ORB with 1,000 features",
               "dynamic_slam_track_bench"};
  app.add_option("SOURCE", arguments.source,
                 "Sequence (default: tum_fr1_desk in the folder DYNAMIC_SLAM_DATA)");
  CLI::Option* camera = app.add_option("--camera", arguments.camera,
                                       "Name of a known camera, or camera file (default: what SOURCE says)");
  app.add_option("--detector", arguments.detector, "As that of `dynamic_slam run`")->capture_default_str();
  app.add_flag("--realtime", arguments.is_realtime, "At the pace of the time stamps, with threads");
  app.add_option("--set", arguments.assignments, "One option, key=value; may be repeated")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);  // else it takes SOURCE
  app.add_flag("--json", arguments.json, "Print one JSON object with all digits");
  CLI11_PARSE(app, argc, argv);
  if (arguments.source.empty()) {
    throw InputError("SOURCE", "is missing", "Name a sequence, or set DYNAMIC_SLAM_DATA.");
  }
  // The default camera belongs to the default source.
  if (arguments.source != default_source && camera->empty()) arguments.camera.clear();
  RunBench(arguments);
  return 0;
}

}  // namespace
}  // namespace dynamic_slam

int main(int argc, char** argv) {
  try {
    return dynamic_slam::Main(argc, argv);
  } catch (const dynamic_slam::InputError& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 1;
  }
}
