#include "dynamic_slam/report/run_report.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/eval/detection_metrics.h"
#include "dynamic_slam/report/data_uri.h"
#include "dynamic_slam/report/path_section.h"
#include "dynamic_slam/report/truth_comparison.h"

namespace dynamic_slam {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kMostFrames = 10000;  // in the charts, for the size of the page
constexpr int kJpegQuality = 78;

// Everything that the sections are made of.
struct Run {
  const SlamSystem& system;
  const RunSummary& summary;
  const RunRecord& record;
  Trajectory path;
  std::optional<TruthComparison> truth;
  std::vector<PoseError> relative;  // errors from frame to frame
  double start_s = 0;
  size_t stride = 1;  // of the frames, those that are shown

  double Since(double timestamp_s) const { return timestamp_s - start_s; }
  double EndS() const { return summary.frames.empty() ? 0 : Since(summary.frames.back().timestamp_s); }
  Json Range() const { return {0, Rounded(std::max(EndS(), 1e-3), 4)}; }
};

Run Gather(const SlamSystem& system, const RunSummary& summary, const RunRecord& record) {
  Run run{system, summary, record, system.FrameTrajectory(), {}, {}};
  if (!summary.frames.empty()) run.start_s = summary.frames.front().timestamp_s;
  run.stride = std::max<size_t>(1, (summary.frames.size() + kMostFrames - 1) / kMostFrames);
  if (!record.truth.has_value() || run.path.empty()) return run;
  try {
    run.truth = CompareWithTruth(*record.truth, run.path);
    run.relative =
        RelativePoseError(MatchByTime(ToPoseList(*record.truth), ToPoseList(run.path), kMaxTruthDifferenceS),
                          Alignment::kSim3, {})
            .errors;
  } catch (const InputError&) {
    // Too few poses to align, or to have a motion: there is no error to show.
  }
  return run;
}

Json Tile(const std::string& label, const std::string& value, const std::string& note = "",
          const std::string& tone = "") {
  return {{"label", label}, {"value", value}, {"note", note}, {"tone", tone}};
}

Json TilesSection(const Run& run) {
  const RunSummary& s = run.summary;
  Json tiles = Json::array();
  const double coverage = s.Coverage();
  tiles.push_back(Tile(
      "frames tracked live", fmt::format("{:.1f}%", 100 * coverage),
      fmt::format("{} of {}, {} given a pose later", s.frames_tracked, s.frames_total, s.frames_backfilled),
      coverage >= 0.9   ? "good"
      : coverage >= 0.5 ? "wait"
                        : "bad"));
  if (run.truth.has_value()) {
    const TruthComparison& truth = *run.truth;
    const double rmse = truth.ape.translation_m.rmse;
    const std::optional<std::string> live =
        DescribeLiveApe(*run.record.truth, run.path, run.system.LiveTrajectory());
    tiles.push_back(Tile("absolute pose error", fmt::format("{:.3g} m", rmse),
                         fmt::format("rmse; {:.2f}% of the path of {:.4g} m{}", 100 * rmse / truth.path_m,
                                     truth.path_m, live.has_value() ? "; " + *live : "")));
  }
  if (!run.relative.empty()) {
    double squares = 0;
    for (const PoseError& error : run.relative) squares += error.translation_m * error.translation_m;
    tiles.push_back(
        Tile("relative pose error",
             fmt::format("{:.3g} m", std::sqrt(squares / static_cast<double>(run.relative.size()))),
             "rmse from frame to frame"));
  }
  tiles.push_back(Tile("tracking a frame", fmt::format("{:.1f} ms", s.tracking_ms.median),
                       fmt::format("median; {:.1f} ms for 95%", s.tracking_ms.p95)));
  tiles.push_back(
      Tile("keyframes", fmt::format("{}", s.keyframes), fmt::format("{} landmarks", s.landmarks)));
  tiles.push_back(Tile(
      "lost", fmt::format("{} times", s.lost_count),
      s.initialised_at.has_value() ? fmt::format("started at frame {}", *s.initialised_at) : "never started",
      s.lost_count > 0 || !s.initialised_at.has_value() ? "wait" : ""));
  if (s.detection.has_value()) {
    tiles.push_back(Tile("keypoints in dynamic boxes", fmt::format("{:.1f}%", 100 * s.mean_dynamic_ratio),
                         fmt::format("mean; detector {}", s.detector)));
  }
  if (s.frames_in_other_maps > 0) {
    tiles.push_back(Tile("frames in other maps", fmt::format("{}", s.frames_in_other_maps),
                         "nothing joins them to this one: trajectory_2.txt and on", "wait"));
  }
  if (!s.leaps.empty()) {
    tiles.push_back(
        Tile("leaps of the path", fmt::format("{}", s.leaps.size()),
             fmt::format("the first at {:.2f} s: unless the film has a cut, one side stands wrong",
                         run.Since(s.leaps[0].from_s)),
             "bad"));
  }
  if (s.pieces_cut > 0) {
    tiles.push_back(
        Tile("pieces cut off", fmt::format("{}", s.pieces_cut), "they stood wrong in the map", "wait"));
  }
  if (s.frames_refuted > 0) {
    tiles.push_back(Tile("poses given up", fmt::format("{}", s.frames_refuted),
                         "the finished map does not confirm them, and the camera cannot have been there",
                         "wait"));
  }
  if (s.lens_doubt.has_value()) {
    tiles.push_back(Tile("lens", fmt::format("k1 {:.4f}, k2 {:.4f}", s.lens_doubt->k1, s.lens_doubt->k2),
                         "fits the images better than what the camera says: ask dynamic_slam doctor",
                         "wait"));
  }
  if (s.loops.corrected + s.loops.linked > 0) {
    tiles.push_back(Tile("loops closed", fmt::format("{}", s.loops.corrected + s.loops.linked),
                         fmt::format("{} moved the map", s.loops.corrected)));
  }
  return {{"type", "tiles"}, {"tiles", std::move(tiles)}};
}

std::vector<Eigen::Vector3f> LandmarksOf(const SlamSystem& system, PartId part) {
  std::vector<Eigen::Vector3f> points;
  const auto map = system.map().Read();
  map->landmarks().ForEach([&](const Landmark& landmark) {
    if (map->PartOf(landmark) == part) points.push_back(landmark.position().cast<float>());
  });
  return points;
}

Json PathOfRun(const Run& run) {
  PathPicture picture{.title = "Path", .note = "", .start_s = run.start_s, .truth = {}, .tracks = {}};
  PathTrack track{.name = "estimate", .colour = "c1", .path = run.path, .shown_from_world = {}};
  if (run.truth.has_value()) {
    picture.truth = run.truth->truth;
    picture.note = "Moved onto the truth by a similarity, as a single camera does not know the scale.";
    track.shown_from_world = run.truth->ape.reference_from_estimate;
    track.errors = run.truth->ape.errors;
  } else {
    picture.note = "In the units of the map: a single camera does not know the scale.";
  }
  picture.tracks.push_back(std::move(track));
  picture.points = LandmarksOf(run.system, run.system.Parts().front());
  return PathsSection(picture);
}

Json StatesOf(const Run& run) {
  Json states = Json::array();
  const auto& frames = run.summary.frames;
  for (size_t i = 0; i < frames.size();) {
    size_t end = i;
    while (end < frames.size() && frames[end].state == frames[i].state) ++end;
    const double until_s = end < frames.size() ? frames[end].timestamp_s : frames.back().timestamp_s;
    states.push_back({Rounded(run.Since(frames[i].timestamp_s), 4), Rounded(run.Since(until_s), 4),
                      Name(frames[i].state)});
    i = end;
  }
  return states;
}

Json EventsOf(const Run& run) {
  Json events = Json::array();
  const auto add = [&](double timestamp_s, const char* kind, const std::string& text) {
    events.push_back({Rounded(run.Since(timestamp_s), 3), kind, text});
  };
  TrackingState last = TrackingState::kInitialising;
  for (size_t i = 0; i < run.summary.frames.size(); ++i) {
    const RunSummary::FrameRecord& frame = run.summary.frames[i];
    const double stamp_s = frame.timestamp_s;
    if (frame.state != last) {
      if (frame.state == TrackingState::kTracking) {
        add(stamp_s, "start", last == TrackingState::kLost ? "found again" : "started");
      } else if (last == TrackingState::kTracking) {
        add(stamp_s, "lost", std::string(run.summary.ReasonOf(i)));
      }
    }
    if (frame.map_was_erased) add(stamp_s, "reset", std::string(run.summary.ReasonOf(i)));
    if (frame.keyframe_reason != KeyframeReason::kNone) {
      add(stamp_s, "keyframe", fmt::format("keyframe: {}", Name(frame.keyframe_reason)));
    }
    if (frame.detection == DetectionState::kLate || frame.detection == DetectionState::kFailed) {
      add(stamp_s, "detector", fmt::format("detector: {}", Name(frame.detection)));
    }
    last = frame.state;
  }
  for (const LoopAttempt& attempt : run.summary.loops.attempts) {
    if (!attempt.reason.empty()) continue;
    add(attempt.timestamp_s, "loop",
        fmt::format("the place of {:.2f} s known again", run.Since(attempt.candidate_timestamp_s)));
  }
  return events;
}

// Charts over the frames that are shown.
class FrameCharts {
 public:
  explicit FrameCharts(const Run& run) : run_(run), times_(Json::array()) {
    Each([this](const RunSummary::FrameRecord& frame) {
      times_.push_back(Rounded(run_.Since(frame.timestamp_s), 4));
    });
  }

  template <class Value>
  Json Series(const std::string& name, const std::string& colour, Value&& value) const {
    Json values = Json::array();
    Each([&](const RunSummary::FrameRecord& frame) { values.push_back(value(frame)); });
    return {{"name", name}, {"colour", colour}, {"v", std::move(values)}};
  }

  // A vector, as of braces with a single Json in them clang makes that Json, and not an array of it.
  Json Chart(const std::string& title, const std::string& unit, const std::string& kind,
             const std::vector<Json>& series) const {
    return {{"title", title}, {"unit", unit}, {"kind", kind}, {"t", times_}, {"series", series}};
  }

 private:
  template <class Function>
  void Each(Function&& function) const {
    for (size_t i = 0; i < run_.summary.frames.size(); i += run_.stride) function(run_.summary.frames[i]);
  }

  const Run& run_;
  Json times_;
};

Json ErrorChart(const Run& run, const std::string& title, const std::string& unit,
                const std::vector<PoseError>& errors, double PoseError::*value, const char* colour) {
  Json times = Json::array(), values = Json::array();
  for (size_t i = 0; i < errors.size(); i += run.stride) {
    times.push_back(Rounded(run.Since(errors[i].timestamp_s), 4));
    values.push_back(Rounded(errors[i].*value, 5));
  }
  return {{"title", title},
          {"unit", unit},
          {"kind", "line"},
          {"t", std::move(times)},
          {"series",
           Json::array({{{"name", title.substr(0, 3)}, {"colour", colour}, {"v", std::move(values)}}})}};
}

Json ChartsSection(const Run& run, const std::string& title, const std::string& note,
                   const std::vector<Json>& charts) {
  return {{"type", "charts"}, {"title", title}, {"note", note}, {"range", run.Range()}, {"charts", charts}};
}

Json ErrorsSection(const Run& run) {
  std::vector<Json> charts;
  charts.push_back(
      ErrorChart(run, "APE, translation", "m", run.truth->ape.errors, &PoseError::translation_m, "c1"));
  if (!run.relative.empty()) {
    charts.push_back(ErrorChart(run, "RPE, translation", "m", run.relative, &PoseError::translation_m, "c3"));
    charts.push_back(ErrorChart(run, "RPE, rotation", "deg", run.relative, &PoseError::rotation_deg, "c4"));
  }
  return ChartsSection(
      run, "Errors",
      "Absolute (APE) after alignment by a similarity, and relative (RPE) from one frame with "
      "a pose to the next, as evo defines them.",
      charts);
}

Json KeypointsSection(const Run& run) {
  using Frame = RunSummary::FrameRecord;
  const FrameCharts charts(run);
  const std::vector<Json> stack = {
      charts.Series("static", "c3", [](const Frame& f) { return f.dynamic.outside; }),
      charts.Series("dynamic, kept", "c5", [](const Frame& f) { return f.dynamic.kept; }),
      charts.Series("dynamic, culled", "c2", [](const Frame& f) { return f.dynamic.culled; })};
  const std::vector<Json> inliers = {
      charts.Series("landmarks that hold the pose", "c1", [](const Frame& f) { return f.inliers; })};
  return ChartsSection(
      run, "Keypoints",
      "Static ones lie in no box of a dynamic object. Of the dynamic ones, those are kept that "
      "move as what is at rest does.",
      {charts.Chart("Keypoints", "", "stack", stack), charts.Chart("Landmarks in use", "", "line", inliers)});
}

Json MapSection(const Run& run) {
  using Frame = RunSummary::FrameRecord;
  const FrameCharts charts(run);
  return ChartsSection(
      run, "Map growth", "",
      {charts.Chart("Keyframes", "", "line",
                    {charts.Series("keyframes", "c1", [](const Frame& f) { return f.map_keyframes; })}),
       charts.Chart("Landmarks", "", "line",
                    {charts.Series("landmarks", "c3", [](const Frame& f) { return f.map_landmarks; })})});
}

Json StagesSection(const Run& run) {
  Json rows = Json::array();
  const auto add = [&rows](const char* name, const TimeStatistics& ms) {
    rows.push_back({{"name", name},
                    {"values", Json::array({{{"v", Rounded(ms.median, 3)},
                                             {"lo", Rounded(ms.median, 3)},
                                             {"hi", Rounded(ms.p95, 3)}}})}});
  };
  add("tracking, a frame", run.summary.tracking_ms);
  if (run.summary.detection.has_value()) {
    add("detector, an image", SummariseTimes(run.summary.detection->times_ms));
  }
  add("mapping, a keyframe", run.summary.mapping_ms);
  add("loops, a keyframe", SummariseTimes(run.summary.loops.times_ms));
  return {{"type", "bars"},
          {"title", "Time of the stages"},
          {"short", "Time"},
          {"note", fmt::format("Median, and what 95% stay below. {:.1f} s in all, {:.0f} MB at most.",
                               run.summary.wall_s, run.summary.peak_rss_mb)},
          {"unit", "ms"},
          {"series", Json::array({{{"name", "median"}, {"colour", "c1"}}})},
          {"rows", std::move(rows)}};
}

Json TrackingTimeSection(const Run& run) {
  const FrameCharts charts(run);
  const std::vector<Json> series = {charts.Series(
      "tracking", "c1", [](const RunSummary::FrameRecord& f) { return Rounded(f.tracking_ms, 2); })};
  return ChartsSection(run, "Time of the frames", "From the image in memory to its pose.",
                       {charts.Chart("Tracking", "ms", "line", series)});
}

using BoxesByStamp = std::map<int64_t, std::vector<BoxRecord>>;

BoxesByStamp ByStamp(const std::vector<BoxRecord>& boxes) {
  BoxesByStamp sorted;
  for (const BoxRecord& box : boxes) sorted[std::llround(1e6 * box.timestamp_s)].push_back(box);
  return sorted;
}

Json RecallSection(const Run& run) {
  const BoxesByStamp truth = ByStamp(run.record.true_boxes), detected = ByStamp(run.record.detected),
                     compensated = ByStamp(run.record.compensated);
  const auto compare = [&](double timestamp_s, const BoxesByStamp& found) {
    static const std::vector<BoxRecord> kNone;
    const int64_t key = std::llround(1e6 * timestamp_s);
    const auto of = [key](const BoxesByStamp& boxes) -> const std::vector<BoxRecord>& {
      const auto at = boxes.find(key);
      return at == boxes.end() ? kNone : at->second;
    };
    return CompareFrame(of(truth), of(found), {.class_name = ""});
  };
  const FrameCharts charts(run);
  using Frame = RunSummary::FrameRecord;
  Json all = charts.Series("true boxes", "c6", [&](const Frame& f) {
    const DetectionMetrics m = compare(f.timestamp_s, detected);
    return m.hits + m.misses;
  });
  all["wide"] = true;
  const Json before = charts.Series("found by the detector", "c2",
                                    [&](const Frame& f) { return compare(f.timestamp_s, detected).hits; });
  const Json after = charts.Series("after compensation", "c1",
                                   [&](const Frame& f) { return compare(f.timestamp_s, compensated).hits; });
  const DetectionMetricsOptions any{.class_name = ""};
  const DetectionMetrics total_before = CompareBoxes(run.record.true_boxes, run.record.detected, any),
                         total_after = CompareBoxes(run.record.true_boxes, run.record.compensated, any);
  return ChartsSection(
      run, "Detector",
      fmt::format("Recall {:.1f}% and precision {:.1f}% of {}, {:.1f}% and {:.1f}% after compensation.",
                  100 * total_before.Recall(), 100 * total_before.Precision(), run.summary.detector,
                  100 * total_after.Recall(), 100 * total_after.Precision()),
      {charts.Chart("Boxes of people and cars", "", "line", {all, before, after})});
}

Json ObjectsSection(const Run& run) {
  const FrameCharts charts(run);
  const std::vector<Json> series = {
      charts.Series("objects", "c1", [](const RunSummary::FrameRecord& f) { return f.objects; })};
  return ChartsSection(run, "Detector", "True boxes are not known here.",
                       {charts.Chart("Objects in the frame, detected or compensated", "", "line", series)});
}

Json ConfigSection(const SystemOptions& options) {
  SystemOptions used = options, standard;
  const std::vector<OptionEntry> entries = CollectOptions(used), defaults = CollectOptions(standard);
  Json changed = Json::array();
  for (size_t i = 0; i < entries.size(); ++i) {
    const std::string value = ValueText(entries[i]), usual = ValueText(defaults[i]);
    if (value != usual) changed.push_back({entries[i].key, value, usual});
  }
  return {{"type", "config"},
          {"title", "Configuration"},
          {"note",
           changed.empty() ? "All options have their defaults." : "Options that differ from their defaults."},
          {"changed", std::move(changed)},
          {"yaml", OptionsToYaml(options)}};
}

std::string Subtitle(const Run& run) {
  const RunSummary& s = run.summary;
  return fmt::format("{} · {} · camera {} · {} · detector {} · version {}", s.source, s.layout, s.camera,
                     Name(s.mode), s.detector, DYNAMIC_SLAM_VERSION) +
         (s.interrupted ? " · interrupted" : "") +
         (s.failure != nullptr ? " · failed: " + FailureMessage(s) : "");
}

}  // namespace

ReportPage MakeRunPage(const std::string& title, const SlamSystem& system, const RunSummary& summary,
                       const RunRecord& record) {
  const Run run = Gather(system, summary, record);
  ReportPage page{.title = title, .subtitle = Subtitle(run), .times_s = {}};
  for (size_t i = 0; i < summary.frames.size(); i += run.stride) {
    page.times_s.push_back(run.Since(summary.frames[i].timestamp_s));
  }
  page.sections.push_back(TilesSection(run));
  if (!run.path.empty()) page.sections.push_back(PathOfRun(run));
  page.sections.push_back({{"type", "timeline"},
                           {"title", "Time line"},
                           {"range", run.Range()},
                           {"states", StatesOf(run)},
                           {"events", EventsOf(run)}});
  if (run.truth.has_value()) page.sections.push_back(ErrorsSection(run));
  page.sections.push_back(KeypointsSection(run));
  if (!record.true_boxes.empty() && summary.detection.has_value()) {
    page.sections.push_back(RecallSection(run));
  } else if (summary.detection.has_value()) {
    page.sections.push_back(ObjectsSection(run));
  }
  if (!record.frames.empty()) page.sections.push_back(FramesSection(record.frames));
  page.sections.push_back(StagesSection(run));
  page.sections.push_back(TrackingTimeSection(run));
  page.sections.push_back(MapSection(run));
  page.sections.push_back(ConfigSection(system.options()));
  return page;
}

nlohmann::ordered_json FramesSection(const std::vector<ChosenFrame>& frames, int width_px) {
  Json list = Json::array();
  for (const ChosenFrame& frame : frames) {
    cv::Mat picture = frame.picture;
    if (picture.cols > width_px) {
      cv::resize(frame.picture, picture, {width_px, width_px * picture.rows / picture.cols}, 0, 0,
                 cv::INTER_AREA);
    }
    list.push_back({{"src", JpegDataUri(picture, kJpegQuality)},
                    {"caption", frame.caption},
                    {"width", picture.cols},
                    {"height", picture.rows}});
  }
  return {{"type", "frames"},
          {"title", "Frames"},
          {"note",
           "Boxes: detected red, compensated green; the mask of dynamic objects is shaded. Keypoints: green "
           "holds the pose, yellow does so in a dynamic box, red is not trusted, grey has no landmark."},
          {"frames", std::move(list)}};
}

}  // namespace dynamic_slam
