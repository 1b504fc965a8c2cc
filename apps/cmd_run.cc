#include "cmd_run.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <fmt/format.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/eval/scale_source.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/io/fault_injection.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/io/live_source.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/map/map_file.h"
#include "dynamic_slam/semantics/dynamic_prior.h"
#include "dynamic_slam/system/run_journal.h"
#include "dynamic_slam/system/sequence_runner.h"
#include "dynamic_slam/system/slam_system.h"
#include "extra_output.h"
#include "mask_folder.h"
#include "overlay_writer.h"
#include "run_console.h"
#include "run_recorder.h"
#include "run_viewer.h"
#include "source_arguments.h"
#include "truth_report.h"
#include "unmatched_inputs.h"

namespace dynamic_slam {
namespace {

struct RunArguments {
  std::string source;
  std::string camera;
  std::string config;
  std::vector<std::string> assignments;
  std::string detector = "none";
  std::string mode;
  std::string out;
  std::string trace;
  std::string truth;
  std::string scale_from;
  std::string models;
  std::string overlay, masks, export_masks;
  std::string save_map, load_map;
  bool localise_only = false, no_backfill = false;
  std::string faults;
  double save_map_every_min = 0;
  std::optional<double> detector_latency_ms;
  FrameSourceOptions source_options;
  bool quiet = false;
  ViewerArguments viewer;
};

std::filesystem::path OutputFolder(const RunArguments& arguments) {
  if (!arguments.out.empty()) return arguments.out;
  if (IsLiveSource(arguments.source)) return LiveFolder("out", arguments.source);
  std::filesystem::path source = std::filesystem::absolute(arguments.source).lexically_normal();
  if (source.filename().empty()) source = source.parent_path();
  if (!std::filesystem::is_directory(source)) return std::filesystem::path("out") / source.stem();
  // EuRoC's folders all have these names.
  while (source.filename() == "mav0" || source.filename() == "cam0") source = source.parent_path();
  return std::filesystem::path("out") / source.filename();
}

void EndTrace(const std::string& file) {
  const TraceSummary trace = WriteTrace(file);
  const std::string dropped =
      trace.dropped > 0 ? fmt::format(", {} more dropped for want of room", trace.dropped) : "";
  fmt::print("trace: {} ({} events{})\n", file, trace.events, dropped);
}

// Whether any of its classes counts as moving; a detector none of whose does is of no use, and says nothing.
void WarnOfDetector(const Detector& detector, const DetectionOptions& options, const RunConsole& console) {
  for (const std::string& warning : detector.warnings()) console.Say(fmt::format("warning: {}", warning));
  const std::vector<double> scores = ClassScores(LoadDynamicPrior(options.prior), detector.class_names());
  const bool may_move = std::any_of(scores.begin(), scores.end(),
                                    [&](double score) { return score > options.score.threshold; });
  if (may_move || scores.empty()) return;
  console.Say(fmt::format(
      "warning: the detector finds nothing that counts as moving: none of its classes ({}) scores above "
      "{} in detector.prior ({}). Name them there.",
      fmt::join(detector.class_names(), ", "), options.score.threshold, options.prior));
}

// What the options say of maps between runs.
void CheckMapOptions(const RunArguments& arguments, const SystemOptions& options) {
  if (arguments.save_map_every_min > 0 && arguments.save_map.empty()) {
    throw InputError("--save-map-every", "no map is saved", "Name the file with --save-map.");
  }
  if (!options.tracker.localise_only) return;
  if (arguments.load_map.empty()) {
    throw InputError("--localise-only", "there is no map to localise in", "Give one with --load-map FILE.");
  }
  if (!arguments.save_map.empty()) {
    throw InputError("--save-map", "the map does not change with --localise-only", "Leave one of them out.");
  }
}

// Saves the map every few minutes, so that little of it is lost with a program that is killed.
class Checkpoint {
 public:
  // every_min: 0: never.
  Checkpoint(std::string file, double every_min, const RunConsole& console)
      : console_(console), file_(std::move(file)), every_min_(every_min) {}

  void SaveIfDue(const SlamSystem& system) {
    const auto now = std::chrono::steady_clock::now();
    if (every_min_ == 0 || std::chrono::duration<double, std::ratio<60>>(now - last_).count() < every_min_)
      return;
    last_ = now;
    try {
      std::string bytes;
      {
        const auto map = system.map().Read();
        bytes = EncodeMap(system.camera(), *map);
      }
      WriteFileAtomically(file_, bytes);
    } catch (const InputError& error) {
      console_.Say(fmt::format("warning: {}", error.what()));
    }
  }

 private:
  const RunConsole& console_;
  std::string file_;
  double every_min_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// What --scale-from asks for. A file is read before the run: whoever mistypes it must not learn that after
// it.
struct WantedScale {
  ScaleSource source;
  Trajectory metric;  // of KnownTrajectory

  explicit WantedScale(const RunArguments& arguments) : source(ParseScaleSource(arguments.scale_from)) {
    if (const auto* known = std::get_if<KnownTrajectory>(&source)) {
      metric = ReadGroundTruth(known->file, arguments.source);
    }
  }
};

// How long the unit of the main part of the map is; a reason is said where that cannot be told.
std::optional<MetricScale> FindScale(const WantedScale& wanted, const SlamSystem& system) {
  const Trajectory trajectory = system.FrameTrajectory();
  try {
    if (trajectory.empty()) throw InputError("--scale-from", "there is no map", "");
    MetricScale scale;
    if (const auto* distance = std::get_if<KnownDistance>(&wanted.source)) {
      scale = ScaleFromDistance(trajectory, *distance);
    } else if (const auto* height = std::get_if<KnownHeight>(&wanted.source)) {
      const PartId part = system.Parts().front();  // before the map is held: it looks into it too
      scale = ScaleFromHeight(*system.map().Read(), part, *height, system.options().seed);
    } else {
      scale = ScaleFromTrajectory(trajectory, wanted.metric,
                                  std::get<KnownTrajectory>(wanted.source).file.string());
    }
    fmt::print("scale: {:.4f} m a unit, +- {:.1f} % ({}); results are in metres\n", scale.metres_per_unit,
               100 * scale.relative_error, scale.from);
    return scale;
  } catch (const InputError& error) {
    fmt::print("no scale, results are in units of the map: {}\n", error.what());
    return std::nullopt;
  }
}

// Writes files each for itself: what cannot be written does not take the others along.
class FileWriter {
 public:
  // Whether that was possible.
  bool Try(const std::function<void()>& write) {
    try {
      write();
      return true;
    } catch (const std::exception&) {
      Note(std::current_exception());
      return false;
    }
  }

  // Something else could not be written, if that is not null.
  void Note(const std::exception_ptr& failure) {
    if (failure_ == nullptr) failure_ = failure;
  }

  // Throws what the first of them threw, if any did.
  void ThrowFailure() const {
    if (failure_ != nullptr) std::rethrow_exception(failure_);
  }

 private:
  std::exception_ptr failure_;
};

void RunSource(const RunArguments& arguments, int* exit_code) {
  TraceThreadName("main");
  if (!arguments.trace.empty()) StartTrace();
  SystemOptions options;
  if (!arguments.config.empty()) LoadProfile(arguments.config, &options);
  ApplySet(&options, arguments.assignments);
  if (arguments.detector_latency_ms) options.detector.latency_ms = *arguments.detector_latency_ms;
  options.tracker.localise_only |= arguments.localise_only;
  options.backfill &= !arguments.no_backfill;
  CheckMapOptions(arguments, options);
  std::optional<WantedScale> wanted_scale;
  if (!arguments.scale_from.empty()) wanted_scale.emplace(arguments);
  const std::shared_ptr<Detector> detector = MakeDetector(arguments.detector, arguments.models);
  RunConsole console(arguments.quiet);
  if (detector != nullptr) WarnOfDetector(*detector, options.detector, console);
  FrameSourceOptions source_options = arguments.source_options;
  source_options.on_event = [&console](const std::string& event) { console.Say(event); };
  source_options.should_stop = [&console] { return console.ShouldStop(); };
  std::unique_ptr<FrameSource> source = OpenFrameSource(arguments.source, source_options);
  if (!arguments.faults.empty()) {
    source = InjectFaults(std::move(source), ParseFaults(arguments.faults, "--inject"));
  }
  const std::string source_name = WithoutPassword(arguments.source);
  const Camera camera = ChooseCamera(arguments.camera, source_name, *source);
  const std::filesystem::path out = OutputFolder(arguments);
  const bool is_named_by_us = arguments.out.empty() && IsLiveSource(arguments.source);
  if (is_named_by_us) console.Say(fmt::format("results will be in {}", out.string()));
  std::optional<Trajectory> truth;
  if (!arguments.truth.empty()) truth = ReadGroundTruth(arguments.truth, arguments.source);
  const bool is_realtime = arguments.mode.empty() ? source->IsLive() : arguments.mode == "realtime";
  SlamSystem system(camera, options, is_realtime ? RunMode::kRealtime : RunMode::kOffline);
  RunRecorder recorder(source_name, camera, options.image);
  system.SetDetector(recorder.Record(detector));
  const auto load_map = [&] {
    if (!arguments.load_map.empty()) system.LoadMap(ReadMapFile(arguments.load_map), arguments.load_map);
  };
  load_map();
  if (!arguments.masks.empty() && !std::filesystem::is_directory(arguments.masks)) {
    throw InputError(arguments.masks, "is no folder", "Give --masks the folder with a PNG for each image.");
  }
  PrepareOutputFolder(out);
  if (!arguments.trace.empty()) CheckCanBeWritten(arguments.trace);
  if (!arguments.save_map.empty()) CheckCanBeWritten(arguments.save_map);
  RunControl control = console.Control();
  const cv::Size size(system.camera().width, system.camera().height);
  std::optional<MaskFolder> masks, given_masks;
  if (!arguments.masks.empty()) {
    given_masks.emplace(arguments.masks, size);
    control.mask = [folder = *given_masks](const SourceImage& image) { return folder.Read(image); };
  }
  UnmatchedInputs unmatched(arguments.detector, given_masks, console);
  if (!arguments.export_masks.empty()) {
    PrepareOutputFolder(arguments.export_masks);
    masks.emplace(arguments.export_masks, size);
  }
  std::optional<OverlayWriter> overlay;
  if (!arguments.overlay.empty()) {
    overlay.emplace(arguments.overlay, camera, options.image);
  }
  std::optional<RunViewer> viewer;
  if (arguments.viewer.IsWanted()) {
    viewer.emplace(arguments.viewer, out, out.filename().string(), camera, options, system.mode());
  }
  const auto reset = [&] {
    system.Reset();
    load_map();
  };
  ExtraOutput overlay_output("--overlay", console), masks_output("--export-masks", console),
      recording_output("--record", console);
  RunJournal journal(out);
  if (!journal.kept().empty()) {
    console.Say(fmt::format("the journal of a run that was killed is kept: dynamic_slam recover {}",
                            journal.kept().string()));
  }
  Checkpoint checkpoint(arguments.save_map, arguments.save_map_every_min, console);
  control.on_frame = [&](const RunProgress& progress) {
    console.Show(progress);
    const Frame& frame = *progress.frame_in_work;
    if (!journal.Add(*progress.record, progress.result->tracking.reason,
                     progress.map->Read()->PartOf(frame.reference), frame.cam_from_world.Inverse())) {
      console.Say("warning: there is no more space for the journal: a run that is killed now loses the rest");
    }
    checkpoint.SaveIfDue(system);
    recorder.Watch(progress);
    unmatched.Watch(*progress.image);
    if (overlay.has_value()) overlay_output.Try([&] { overlay->Write(progress); });
    if (masks.has_value()) masks_output.Try([&] { masks->Write(*progress.image, *progress.result); });
    if (viewer.has_value()) {
      viewer->Watch(progress, system, reset, control.should_stop);
      recording_output.Try([&] { viewer->CheckRecording(); });
    }
  };
  RunSummary summary = RunSequence(*source, system, control);
  summary.source = source_name;
  console.End();
  unmatched.Finish();
  const bool is_hopeless = summary.failure != nullptr && summary.frames.empty();
  if (is_hopeless) std::rethrow_exception(summary.failure);
  if (wanted_scale.has_value()) summary.scale = FindScale(*wanted_scale, system);
  FileWriter files;
  const bool has_results = files.Try([&] { WriteResults(out, system, summary); });
  if (has_results) journal.Remove();
  const bool saves_map = !arguments.save_map.empty() && summary.failure == nullptr;
  const bool has_map = saves_map && files.Try([&] {
    WriteMapFile(arguments.save_map, system.camera(), *system.map().Read());
  });
  if (!arguments.save_map.empty() && !has_map)
    console.Say(fmt::format("warning: the map is not saved: {}", arguments.save_map));
  if (arguments.truth.empty()) truth = FindTruth(arguments.source);
  const bool has_report = files.Try([&] {
    WriteRunReport(out, out.filename().string(), system, summary, recorder.Finish(summary, truth));
  });
  PrintSummary(summary);
  if (truth.has_value()) {
    files.Try([&] { ReportTruth(*truth, system.FrameTrajectory(), system.LiveTrajectory(), out); });
  }
  if (!arguments.trace.empty()) files.Try([&] { EndTrace(arguments.trace); });
  if (!has_results)
    console.Say(fmt::format("Make space; dynamic_slam recover {} then writes the path.", out.string()));
  if (has_map) fmt::print("map: {}\n", arguments.save_map);
  if (has_results && has_report)
    fmt::print("results: {}, report: {}\n", out.string(), (out / "report.html").string());
  // After all results: a recording that cannot be written must not take them along.
  if (viewer.has_value()) {
    viewer->Finish(system);
    recording_output.Try([&] { viewer->CheckRecording(); });
  }
  for (const ExtraOutput* extra : {&overlay_output, &masks_output, &recording_output})
    files.Note(extra->failure());
  if (summary.failure != nullptr) std::rethrow_exception(summary.failure);  // the cause of all else
  files.ThrowFailure();
  if (const std::string reason = source->EndReason(); !reason.empty()) {
    throw InputError(source_name, reason,
                     "These are the results up to then. Check cable, power and network.");
  }
  if (summary.interrupted) *exit_code = kExitInterrupted;
}

}  // namespace

void AddRunCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand("run", "Find the camera's path through a sequence, and a map");
  const auto arguments = std::make_shared<RunArguments>();
  RunArguments& a = *arguments;
  command
      ->add_option("SOURCE", a.source,
                   "Folder in TUM RGB-D, KITTI odometry or EuRoC layout, folder of images, video file, "
                   "camera:0, or rtsp://...")
      ->required();
  command->add_option("--camera", a.camera,
                      "Name of a known camera, or camera file (default: what SOURCE says)");
  command->add_option(
      "--config", a.config,
      "YAML file with options (the keys of config.yaml in the results), or a profile: " + ProfileHelp());
  command->add_option("--set", a.assignments, "One option, key=value; may be repeated")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);  // else it takes SOURCE
  command->add_option("--detector", a.detector, "Object detector: " + DetectorHelp())->capture_default_str();
  command->add_option("--models", a.models, "Folder in which network files are looked for too");
  command
      ->add_option("--detector-latency-ms", a.detector_latency_ms,
                   "Simulate a network that answers so much later")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--overlay", a.overlay,
                      "Folder for the frames with their objects: detected red, compensated green");
  command->add_option("--masks", a.masks,
                      "Folder with a mask for each image, NAME.png: no keypoints where it is not 0");
  command->add_option("--export-masks", a.export_masks,
                      "Folder for the masks of the dynamic objects (Eq. 11)");
  command
      ->add_option("--mode", a.mode,
                   "offline: every frame, reproducible. realtime: at the pace of the time stamps; "
                   "frames that come too fast are dropped (default: realtime of a camera, else offline)")
      ->check(CLI::IsMember({"offline", "realtime"}));
  command->add_option("--out", a.out, "Folder for the results (default: out/ and the name of SOURCE)");
  command->add_option("--save-map", a.save_map, "File for the map, for later runs and `dynamic_slam map`");
  command
      ->add_option("--save-map-every", a.save_map_every_min,
                   "Minutes after which --save-map is written while the run goes on (0: only at its end)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--load-map", a.load_map,
                      "Map of an earlier run with the same camera: it is looked for first, and grows");
  command->add_flag("--localise-only", a.localise_only,
                    "Only poses in the map of --load-map, which stays as it is");
  command->add_flag("--no-backfill", a.no_backfill,
                    "Frames that had no pose when their turn came do not get one in the finished map");
  command->add_option("--trace", a.trace,
                      "File for the times of all stages (Chrome trace, for ui.perfetto.dev)");
  command->add_option("--truth", a.truth,
                      "Ground truth, in TUM's or KITTI's format (default: that beside the images)");
  command
      ->add_option(
          "--scale-from", a.scale_from,
          "Results in metres: distance:A,B,METRES between two times, s; camera-height:METRES above the "
          "ground; file:TRAJECTORY in metres")
      ->type_name("WHAT");
  AddViewerOptions(command, &a.viewer);
  AddSourceOptions(command, &a.source_options);
  command->add_option(
      "--inject", a.faults,
      "Faults of the camera, to see what becomes of a run: drop=0.05,black=0.02,from=2,to=4; also "
      "blur, exposure, freeze, resize, stamp, swap (shares of the frames), seed");
  command->add_flag("--quiet", a.quiet, "No progress line");
  command->footer(
      "Examples:\n"
      "  dynamic_slam run rgbd_dataset_freiburg1_desk --camera tum_fr1\n"
      "  dynamic_slam run kitti/sequences/00 --out out/kitti_00 --set orb.features=2000\n"
      "  dynamic_slam run video.mp4 --camera my_camera.yaml\n"
      "  dynamic_slam run camera:0 --camera my_camera.yaml --viewer");
  command->callback([arguments, exit_code] { RunSource(*arguments, exit_code); });
}

}  // namespace dynamic_slam
