#include "cmd_config.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "dynamic_slam/base/options.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/camera_import.h"
#include "dynamic_slam/system/system_options.h"
#include "man_page.h"

namespace dynamic_slam {
namespace {

// One of them is given.
struct ConfigArguments {
  bool defaults = false, markdown = false, man = false;
  std::optional<std::string> explain, check, import_camera;
  std::vector<int> image_size;  // px; empty, or width and height
};

void PrintDefaults() { fmt::print("{}", OptionsToYaml(SystemOptions())); }

void Explain(const std::string& key) {
  SystemOptions defaults;
  fmt::print("{}", ExplainEntries(CollectOptions(defaults), key));
}

// The problems of the file are those that LoadOptions throws.
void Check(const std::string& file) {
  SystemOptions options, defaults;
  const std::vector<std::string> keys = LoadOptions(file, &options);
  const std::vector<OptionEntry> entries = CollectOptions(options),
                                 default_entries = CollectOptions(defaults);
  std::string differences;
  int count = 0;
  for (size_t i = 0; i < entries.size(); ++i) {
    const std::string value = ValueText(entries[i]), default_value = ValueText(default_entries[i]);
    if (value == default_value) continue;
    differences += fmt::format("  {}: {} (default {})\n", entries[i].key, value, default_value);
    ++count;
  }
  fmt::print("{}: {} {} set, {} of them {} from the defaults\n{}", file, keys.size(),
             keys.size() == 1 ? "option" : "options", count, count == 1 ? "differs" : "differ", differences);
}

// docs/config.md
void PrintMarkdown() {
  SystemOptions defaults;
  fmt::print(
      "# Options\n\n"
      "This page is generated from the option lists in the code, and not edited; this renews it:\n\n"
      "    dynamic_slam config --markdown > docs/config.md\n\n"
      "`dynamic_slam run` takes options from a YAML file (`--config FILE`) and one by one (`--set "
      "orb.features=2000`, "
      "which\n"
      "wins); those of a run are in the `config.yaml` of its results. `dynamic_slam config --defaults` "
      "prints a file to "
      "start\n"
      "from, `--check FILE` finds what is wrong with one, `--explain KEY` says what is here on the "
      "terminal.\n\n"
      "{}",
      EntriesToMarkdown(CollectOptions(defaults)));
}

void PrintImportedCamera(const std::string& file, const std::vector<int>& image_size) {
  std::optional<cv::Size> size;
  if (!image_size.empty()) size = cv::Size(image_size[0], image_size[1]);
  fmt::print("{}", CameraToYaml(ImportCamera(file, size)));
}

void RunConfig(const ConfigArguments& arguments, const CLI::App& app) {
  if (arguments.defaults) PrintDefaults();
  if (arguments.explain) Explain(*arguments.explain);
  if (arguments.check) Check(*arguments.check);
  if (arguments.markdown) PrintMarkdown();
  if (arguments.man) fmt::print("{}", ManPage(app));
  if (arguments.import_camera) PrintImportedCamera(*arguments.import_camera, arguments.image_size);
}

}  // namespace

void AddConfigCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("config", "Show, explain or check the options of run; import cameras");
  const auto arguments = std::make_shared<ConfigArguments>();
  ConfigArguments& a = *arguments;
  CLI::Option_group* what = command->add_option_group("What to do");
  what->require_option(1);
  what->add_flag("--defaults", a.defaults, "Print all options with their defaults, as YAML with comments");
  what->add_option("--explain", a.explain, "Say what an option, or each of a section, does and may be")
      ->type_name("KEY");
  what->add_option("--check", a.check, "Find everything that is wrong with a YAML file of options")
      ->type_name("FILE");
  what->add_flag("--markdown", a.markdown, "Print the page docs/config.md");
  what->add_flag("--man", a.man, "Print the manual page, for man");
  what->add_option("--import-camera", a.import_camera,
                   "Print the camera file for a calibration file of ORB-SLAM2, ORB-SLAM3, OpenVSLAM, "
                   "stella_vslam, Kalibr or EuRoC")
      ->type_name("FILE");
  command
      ->add_option("--image-size", a.image_size,
                   "Width and height, px, for a calibration file that does not hold them")
      ->expected(2)
      ->type_name("W H");
  command->footer(
      "Examples:\n"
      "  dynamic_slam config --defaults > my.yaml\n"
      "  dynamic_slam config --check my.yaml\n"
      "  dynamic_slam config --explain tracker.keyframe\n"
      "  dynamic_slam config --import-camera TUM1.yaml --image-size 640 480 > my_camera.yaml");
  command->callback([arguments, &app] { RunConfig(*arguments, app); });
}

}  // namespace dynamic_slam
