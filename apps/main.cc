#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <opencv2/core.hpp>

#include "cmd_bench.h"
#include "cmd_calibrate.h"
#include "cmd_config.h"
#include "cmd_demo.h"
#include "cmd_detect.h"
#include "cmd_doctor.h"
#include "cmd_eval.h"
#include "cmd_map.h"
#include "cmd_models.h"
#include "cmd_recover.h"
#include "cmd_run.h"
#include "cmd_simulate.h"
#ifdef DYNAMIC_SLAM_HAS_VIEWER
#include "cmd_view.h"
#endif
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/worker.h"
#include "run_viewer.h"

namespace {

// What the user can put right, and what only we can.
constexpr int kExitBug = 1;
constexpr int kExitInput = 2;

// What the machine has run out of; "" when it is something else.
std::string Exhausted(const std::exception& error) {
  const auto* opencv = dynamic_cast<const cv::Exception*>(&error);
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr ||
      (opencv != nullptr && opencv->code == cv::Error::StsNoMem)) {
    return "memory: there is no more of it\n"
           "  Allow the program more, or give it smaller images (image.resize_width) or fewer frames.";
  }
  // Of several types: TBB throws a plain runtime_error.
  const std::string none_can_be_made = std::strerror(EAGAIN);
  if (std::string(error.what()).find(none_can_be_made) != std::string::npos) {
    return fmt::format("threads: none can be made ({})\n  Allow the program more memory or threads.",
                       none_can_be_made);
  }
  return "";
}

// Whether all that was printed could be.
bool IsOutputWhole() { return std::fflush(stdout) == 0 && std::ferror(stdout) == 0; }

// Standard error may be closed too.
void PrintError(const std::string& text) { std::fputs(text.c_str(), stderr); }

int ReportOutput(int error) {
  PrintError(
      fmt::format("error: standard output: cannot be written ({})\n"
                  "  Give it a place with space, or a reader that stays.\n",
                  std::strerror(error)));
  return kExitInput;
}

int Main(int argc, char** argv) {
  CLI::App app("Dynamic-SLAM: the path of one camera, and a map of what stands still around it",
               "dynamic_slam");
  app.set_version_flag("--version", "dynamic_slam " DYNAMIC_SLAM_VERSION);
  app.require_subcommand(1);
  int exit_code = 0;
  dynamic_slam::AddRunCommand(app, &exit_code);
  dynamic_slam::AddRecoverCommand(app);
  dynamic_slam::AddEvalCommand(app);
  dynamic_slam::AddDetectCommand(app, &exit_code);
  dynamic_slam::AddMapCommand(app);
  dynamic_slam::AddCalibrateCommand(app);
  dynamic_slam::AddDoctorCommand(app);
  dynamic_slam::AddModelsCommand(app);
  dynamic_slam::AddSimulateCommand(app);
  dynamic_slam::AddDemoCommand(app, &exit_code);
  dynamic_slam::AddBenchCommand(app, &exit_code);
  dynamic_slam::AddConfigCommand(app);
#ifdef DYNAMIC_SLAM_HAS_VIEWER
  dynamic_slam::AddViewCommand(app);
#endif
  try {
    std::vector<std::string> arguments = dynamic_slam::WithViewerPort({argv + 1, argv + argc});
    std::reverse(arguments.begin(), arguments.end());  // as CLI11 takes them
    app.parse(std::move(arguments));                   // runs the subcommand
    return IsOutputWhole() ? exit_code : ReportOutput(errno);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitInput;  // --help and --version end here with 0
  } catch (const dynamic_slam::InputError& error) {
    PrintError(fmt::format("error: {}\n", error.what()));
    return kExitInput;
  } catch (const std::exception& error) {
    const auto* system = dynamic_cast<const std::system_error*>(&error);
    if (system != nullptr && std::ferror(stdout) != 0) return ReportOutput(system->code().value());
    if (const std::string what = Exhausted(error); !what.empty()) {
      PrintError(fmt::format("error: {}\n", what));
      return kExitInput;
    }
    PrintError(
        fmt::format("internal error: {}\n  This is a bug: please report it with the command that you gave.\n",
                    error.what()));
    return kExitBug;
  }
}

// What is as large as a saved map goes back to the system and leaves no hole, which small things would settle in
// before the next save. The rest is kept, as each frame needs it again.
void SetUpMemory() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, 8 << 20);
  mallopt(M_TRIM_THRESHOLD, 64 << 20);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  SetUpMemory();
  // Who reads what is printed may go away; results are for files.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error like a full disk
  const int code = Main(argc, argv);
  if (dynamic_slam::Worker::AbandonedCount() > 0) {
    // A network that hangs still runs, and uses what destructors would take away.
    std::fflush(nullptr);
    std::_Exit(code);
  }
  return code;
}
