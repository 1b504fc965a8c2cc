#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#ifdef DYNAMIC_SLAM_HAS_VIEWER

#include "dynamic_slam/viewer/live_view.h"

namespace dynamic_slam {

struct ViewerArguments {
  std::optional<uint16_t> port;  // none: no viewer
  std::string address = "127.0.0.1";
  bool is_recorded = false;

  bool IsWanted() const { return port.has_value() || is_recorded; }
};

// The options of `run`.
void AddViewerOptions(CLI::App* command, ViewerArguments* arguments);

// The program's arguments, in which a `--viewer` before something that is no number has its usual port: what
// follows is not its.
std::vector<std::string> WithViewerPort(std::vector<std::string> arguments);

// --viewer-address, and the port under the name that is given.
void AddServerOptions(CLI::App* command, const std::string& port_option, ViewerArguments* arguments);

// Where a viewer listens; with a token unless only this machine can reach it.
ServerOptions ServerOptionsOf(const ViewerArguments& arguments);

// Shows and records a run, and does what browsers wish of it.
class RunViewer {
 public:
  RunViewer(const ViewerArguments& arguments, std::filesystem::path out, const std::string& source,
            const Camera& raw_camera, const SystemOptions& options, RunMode mode);

  // To be called last after each frame: returns when the run goes on. reset: makes the system what it was
  // before the first frame.
  void Watch(const RunProgress& progress, const SlamSystem& system, const std::function<void()>& reset,
             const std::function<bool()>& should_stop);

  // Throws InputError when the recording had to end.
  void CheckRecording() const { view_.CheckRecording(); }

  void Finish(const SlamSystem& system) { view_.Finish(system); }

 private:
  std::filesystem::path out_;
  LiveView view_;
};

}  // namespace dynamic_slam

#else  // built without the view: no option asks for it

namespace dynamic_slam {

struct ViewerArguments {
  bool IsWanted() const { return false; }
};

inline void AddViewerOptions(CLI::App*, ViewerArguments*) {}
inline std::vector<std::string> WithViewerPort(std::vector<std::string> arguments) { return arguments; }

struct RunViewer {
  explicit RunViewer(const auto&...) {}
  void Watch(const auto&...) {}
  void CheckRecording() const {}
  void Finish(const auto&) {}
};

}  // namespace dynamic_slam

#endif
