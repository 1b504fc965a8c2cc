#include "man_page.h"

#include <sstream>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "dynamic_slam/base/options.h"
#include "dynamic_slam/system/system_options.h"

namespace dynamic_slam {
namespace {

// Text as troff prints it literally, line by line.
std::string Literal(std::string_view text) {
  std::string out;
  bool at_start = true;
  for (const char c : text) {
    if (at_start && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
    at_start = c == '\n';
  }
  return out;
}

std::string Item(const std::string& term, const std::string& more, const std::string& text) {
  return fmt::format(".TP\n\\fB{}\\fR{}\n{}\n", Literal(term), more.empty() ? "" : " " + Literal(more),
                     Literal(text.empty() ? "See above." : text));
}

// The argument and what it takes, as --help writes them.
std::string OptionItem(const CLI::Option& option) {
  std::string takes = option.get_positional() ? "" : option.get_type_name();
  if (option.get_expected_max() > 1 && !takes.empty()) takes += " ...";
  std::string text = option.get_description();
  if (!option.get_default_str().empty()) text += fmt::format(" [{}]", option.get_default_str());
  if (option.get_required()) text += " [required]";
  return Item(option.get_name(option.get_positional(), true), takes, text);
}

// One subcommand, with those below it.
std::string CommandSection(const CLI::App& command, const std::string& name) {
  std::string page = fmt::format(".SS \"{}\"\n{}\n", Literal(name), Literal(command.get_description()));
  const auto add_options = [&page](const CLI::App& group) {
    for (const CLI::Option* option : group.get_options()) {
      if (option->get_group().empty() || option->get_name() == "--help") continue;
      page += OptionItem(*option);
    }
  };
  add_options(command);
  std::vector<const CLI::App*> below;
  for (const CLI::App* sub : command.get_subcommands({})) {
    // CLI11 keeps groups of options as subcommands without a name.
    sub->get_name().empty() ? add_options(*sub) : below.push_back(sub);
  }
  if (!command.get_footer().empty()) {
    page += fmt::format(".PP\n.nf\n{}\n.fi\n", Literal(command.get_footer()));
  }
  for (const CLI::App* sub : below) page += CommandSection(*sub, name + " " + sub->get_name());
  return page;
}

std::string SlamOptions() {
  SystemOptions defaults;
  std::string page;
  for (const OptionEntry& entry : CollectOptions(defaults)) {
    const std::string range = RangeText(entry);
    page += Item(entry.key, "",
                 fmt::format("{} Default: {}{}.", entry.field.help, ValueText(entry),
                             range.empty() ? "" : "; " + range));
  }
  return page;
}

}  // namespace

std::string ManPage(const CLI::App& app) {
  std::string page = fmt::format(
      ".TH DYNAMIC_SLAM 1 \"\" \"{}\"\n.SH NAME\ndynamic_slam \\- {}\n"
      ".SH SYNOPSIS\n\\fBdynamic_slam\\fR \\fICOMMAND\\fR [arguments]\n.br\n"
      "\\fBdynamic_slam\\fR [\\fICOMMAND\\fR] \\fB\\-\\-help\\fR\n"
      ".SH DESCRIPTION\n"
      "Follows one camera through a video or a folder of images in which people and cars may move, and "
      "makes\n"
      "a sparse map of what stands still. Each command says with \\-\\-help what it takes.\n.SH COMMANDS\n",
      Literal(app.version()), Literal(app.get_description()));
  for (const CLI::App* command : app.get_subcommands({}))
    page += CommandSection(*command, command->get_name());
  page += ".SH OPTIONS OF THE SLAM\nKeys of the file of \\-\\-config, and of \\-\\-set KEY=VALUE.\n" +
          SlamOptions();
  page += ".SH ENVIRONMENT\n";
  page += Item("DYNAMIC_SLAM_CONFIG", "", "Folder with cameras, detectors, profiles and scenes of your own.");
  page += Item("DYNAMIC_SLAM_MODELS", "", "Folder in which network files are looked for.");
  page += ".SH FILES\n";
  page += Item("share/dynamic_slam/config", "",
               "Cameras, detectors, profiles and scenes that are found by name.");
  page += Item("~/.local/share/dynamic_slam/models", "", "Network files of your own.");
  page += ".SH EXIT STATUS\n";
  page += Item("0", "", "All went well.");
  page += Item("1", "", "A bug of the program.");
  page += Item(
      "2", "",
      "Something that was given is wrong, or the disk is full or the memory used up; the message says what, "
      "and the remedy.");
  page += Item("130", "", "The run was interrupted; what was found until then is in the results.");
  return page;
}

}  // namespace dynamic_slam
