#include "run_viewer.h"

#include <cstdio>
#include <utility>

#include <fmt/core.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/map/map_file.h"

namespace dynamic_slam {
namespace {

constexpr uint16_t kPort = 8090;

LiveViewOptions ViewOptions(const ViewerArguments& arguments, const std::filesystem::path& out,
                            const std::string& source) {
  LiveViewOptions options;
  if (arguments.port.has_value()) options.server = ServerOptionsOf(arguments);
  if (arguments.is_recorded) options.recording = out / kRecordingName;
  options.source = source;
  return options;
}

}  // namespace

void AddViewerOptions(CLI::App* command, ViewerArguments* arguments) {
  AddServerOptions(command, "--viewer", arguments);
  command->add_flag("--record", arguments->is_recorded, "Record the run for `dynamic_slam view`");
}

std::vector<std::string> WithViewerPort(std::vector<std::string> arguments) {
  for (size_t i = 0; i + 1 < arguments.size(); ++i) {
    const std::string& next = arguments[i + 1];
    const bool is_number = !next.empty() && next.find_first_not_of("0123456789") == std::string::npos;
    if (arguments[i] == "--viewer" && !is_number) arguments[i] += fmt::format("={}", kPort);
  }
  return arguments;
}

void AddServerOptions(CLI::App* command, const std::string& port_option, ViewerArguments* arguments) {
  command
      ->add_option_function<uint16_t>(
          port_option, [arguments](uint16_t port) { arguments->port = port; },
          fmt::format("Port of the page for browsers ({} where none is given, 0: any that is free)", kPort))
      ->type_name("[PORT]")
      ->expected(0, 1)
      ->default_str(std::to_string(kPort));
  command
      ->add_option("--viewer-address", arguments->address,
                   "IP address for the page; other machines need the token that is printed then")
      ->capture_default_str();
}

ServerOptions ServerOptionsOf(const ViewerArguments& arguments) {
  return {arguments.address, arguments.port.value_or(kPort), !IsLoopback(arguments.address)};
}

RunViewer::RunViewer(const ViewerArguments& arguments, std::filesystem::path out, const std::string& source,
                     const Camera& raw_camera, const SystemOptions& options, RunMode mode)
    : out_(std::move(out)), view_(ViewOptions(arguments, out_, source), raw_camera, options.image, mode) {
  if (arguments.port.has_value()) fmt::print("viewer: {}\n", view_.url());
  std::fflush(stdout);  // whoever waits for the address
}

void RunViewer::Watch(const RunProgress& progress, const SlamSystem& system,
                      const std::function<void()>& reset, const std::function<bool()>& should_stop) {
  view_.Watch(progress, system);
  while (true) {
    const RunWishes wishes = view_.WaitForWishes(should_stop);
    if (!wishes.saves_map && !wishes.resets) return;
    if (wishes.saves_map) {
      const std::filesystem::path file = out_ / "viewer.map";
      try {
        WriteMapFile(file, system.camera(), *system.map().Read());
        view_.Tell("good", "The map is saved: " + file.string());
      } catch (const InputError& error) {
        view_.Tell("bad", error.what());
      }
    }
    if (wishes.resets) {
      reset();
      view_.WasReset();
    } else {
      view_.ShowEvents();
    }
  }
}

}  // namespace dynamic_slam
