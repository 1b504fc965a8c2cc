// What time and memory do in a long sequence: once a place is mapped, to go round it again should cost
// nothing more.

#include <algorithm>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <time.h>
#include <unistd.h>

#include "bench_run.h"
#include "cmd_bench.h"

namespace dynamic_slam {
namespace {

struct ScaleArguments : BenchArguments {
  size_t window = 250;
  size_t mapped_at = 1000;
};

// Some frames, one after the other.
struct Window {
  size_t first_frame = 0, frames = 0, tracked = 0;
  double tracking_ms = 0;  // median
  double cpu_ms = 0;       // of all stages, mean over its frames
  double rss_mb = 0;       // at its end, as the next two
  size_t keyframes = 0, landmarks = 0;
};

// Processor time of all threads so far: what else the machine does is not in it.
double CpuMs() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double RssMb() {
  std::ifstream statm("/proc/self/statm");
  double pages = 0, resident = 0;
  statm >> pages >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

class WindowLog {
 public:
  explicit WindowLog(size_t frames) : frames_(frames), cpu_ms_(CpuMs()) {}

  void Add(const RunProgress& progress) {
    times_ms_.push_back(progress.result->tracking_ms);
    tracked_ += progress.result->tracking.state == TrackingState::kTracking;
    if (times_ms_.size() < frames_) return;
    const double cpu_ms = CpuMs();
    Window window{progress.frame - frames_, frames_, tracked_};
    window.tracking_ms = SummariseTimes(times_ms_).median;
    window.cpu_ms = (cpu_ms - cpu_ms_) / static_cast<double>(frames_);
    window.rss_mb = RssMb();
    {
      const auto map = progress.map->Read();
      window.keyframes = map->keyframes().size();
      window.landmarks = map->landmarks().size();
    }
    windows_.push_back(window);
    times_ms_.clear();
    tracked_ = 0;
    cpu_ms_ = CpuMs();
  }

  const std::vector<Window>& windows() const { return windows_; }

 private:
  size_t frames_;
  double cpu_ms_;
  size_t tracked_ = 0;
  std::vector<double> times_ms_;
  std::vector<Window> windows_;
};

// How much larger the mean of a quantity is in the last third of the windows in the mapped place than in the
// first third, as a share; 0 when there are fewer than three.
template <class T>
double Growth(const std::vector<Window>& mapped, T Window::*member) {
  const size_t third = mapped.size() / 3;
  if (third == 0) return 0;
  double first = 0, last = 0;
  for (size_t i = 0; i < third; ++i) {
    first += static_cast<double>(mapped[i].*member);
    last += static_cast<double>(mapped[mapped.size() - third + i].*member);
  }
  return first > 0 ? last / first - 1 : 0;
}

// And returns the curves.
CurvePlot Write(const std::filesystem::path& folder, const std::string& name,
                const std::vector<Window>& windows) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  CurvePlot plot{fmt::format("{}: time and memory along the sequence", name), "frame", "", {}};
  plot.curves = {{"tracking a frame, ms", CurveColour(0), {}},
                 {"all stages, ms of processor time a frame", CurveColour(1), {}},
                 {"memory, MB", CurveColour(2), {}},
                 {"keyframes", CurveColour(3), {}}};
  for (const Window& w : windows) {
    rows.push_back({{"first_frame", w.first_frame},
                    {"frames", w.frames},
                    {"tracked", w.tracked},
                    {"tracking_ms", w.tracking_ms},
                    {"cpu_ms", w.cpu_ms},
                    {"rss_mb", w.rss_mb},
                    {"keyframes", w.keyframes},
                    {"landmarks", w.landmarks}});
    const double at = static_cast<double>(w.first_frame + w.frames);
    const double values[] = {w.tracking_ms, w.cpu_ms, w.rss_mb, static_cast<double>(w.keyframes)};
    for (size_t i = 0; i < std::size(values); ++i) plot.curves[i].points.emplace_back(at, values[i]);
  }
  WriteRows(folder, "scale_" + name, rows);
  WriteCurves(folder, "scale_" + name, plot);
  return plot;
}

void RunScale(const ScaleArguments& arguments, int* exit_code) {
  if (!arguments.out.empty()) PrepareOutputFolder(arguments.out);
  RunConsole console(arguments.quiet);
  std::vector<CurvePlot> plots;
  for (const std::string& source : arguments.sources) {
    if (console.ShouldStop()) break;
    WindowLog log(arguments.window);
    const BenchRun run = RunForBench(arguments, source, {}, &console,
                                     [&log](const RunProgress& progress) { log.Add(progress); });
    fmt::print("\n{}\n{:>8} {:>8} {:>12} {:>8} {:>8} {:>10} {:>10}\n", ShortName(source), "frames", "tracked",
               "tracking, ms", "CPU, ms", "RSS, MB", "keyframes", "landmarks");
    std::vector<Window> mapped;
    for (const Window& w : log.windows()) {
      fmt::print("{:>8} {:>8} {:>12.1f} {:>8.1f} {:>8.1f} {:>10} {:>10}\n", w.first_frame + w.frames,
                 w.tracked, w.tracking_ms, w.cpu_ms, w.rss_mb, w.keyframes, w.landmarks);
      if (w.first_frame >= arguments.mapped_at) mapped.push_back(w);
    }
    fmt::print("growth after frame {}: tracking {:+.1f}%, CPU {:+.1f}%, RSS {:+.1f}%, keyframes {:+.1f}%\n",
               arguments.mapped_at, 100 * Growth(mapped, &Window::tracking_ms),
               100 * Growth(mapped, &Window::cpu_ms), 100 * Growth(mapped, &Window::rss_mb),
               100 * Growth(mapped, &Window::keyframes));
    if (!arguments.out.empty()) {
      plots.push_back(Write(arguments.out, ShortName(source), log.windows()));
    }
  }
  if (!arguments.out.empty()) {
    WriteBenchReport(arguments.out, "Time and memory along sequences", arguments, {}, plots);
    fmt::print("results: {}\n", arguments.out);
  }
  if (console.ShouldStop()) *exit_code = kExitInterrupted;
}

}  // namespace

void AddScaleCommand(CLI::App* bench, int* exit_code) {
  CLI::App* command =
      bench->add_subcommand("scale", "Time, memory and keyframes along a sequence, some frames at a time");
  const auto arguments = std::make_shared<ScaleArguments>();
  AddBenchOptions(command, "scale_NAME.csv, .json and .png", arguments.get());
  command->add_option("--window", arguments->window, "Frames of one row")->check(CLI::Range(1, 1000000));
  command->add_option("--mapped-at", arguments->mapped_at,
                      "From this frame on the place is mapped, and nothing should grow");
  command->footer(
      "Growth: the mean over the last third of the rows of the mapped place against that over the first.\n"
      "Example:\n"
      "  dynamic_slam simulate street_short --frames 5000 --out round\n"
      "  dynamic_slam bench scale round --detector boxes:round/boxes.csv --out scale");
  command->callback([arguments, exit_code] { RunScale(*arguments, exit_code); });
}

}  // namespace dynamic_slam
