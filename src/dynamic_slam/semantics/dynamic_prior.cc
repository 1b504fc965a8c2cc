#include "dynamic_slam/semantics/dynamic_prior.h"

#include <cctype>
#include <optional>

#include <yaml-cpp/yaml.h>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

constexpr char kOther[] = "other";

YAML::Node LoadYaml(const std::filesystem::path& file) {
  try {
    return YAML::Load(ReadFile(file, "Check the path."));
  } catch (const YAML::ParserException& e) {
    throw InputError(fmt::format("{}:{}", file.string(), e.mark.line + 1),
                     fmt::format("is not YAML: {}", e.msg), "Write 'NAME: SCORE' lines.");
  }
}

// The score, or nothing when it is no number from 0 to 10.
std::optional<double> ParseScore(const YAML::Node& node) {
  const std::optional<double> score = node.IsScalar() ? ParseDouble(node.Scalar()) : std::nullopt;
  return score && *score >= 0 && *score <= DynamicPrior::kMaxScore ? score : std::nullopt;
}

}  // namespace

double DynamicPrior::Score(std::string_view class_name) const {
  auto found = score_of_class.find(class_name);
  if (found == score_of_class.end()) {
    // KITTI, VisDrone and Open Images write "Person" and "Car".
    std::string lower(class_name);
    for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    found = score_of_class.find(lower);
  }
  return found == score_of_class.end() ? other_score : found->second;
}

std::vector<double> ClassScores(const DynamicPrior& prior, std::span<const std::string> class_names) {
  std::vector<double> scores;
  for (const std::string& name : class_names) scores.push_back(prior.Score(name));
  return scores;
}

DynamicPrior ReadDynamicPrior(const std::filesystem::path& file) {
  const YAML::Node root = LoadYaml(file);
  DynamicPrior prior;
  std::vector<std::string> problems;
  std::map<std::string, int> first_lines;
  const auto add_problem = [&](int line, const std::string& text) {
    problems.push_back(fmt::format("{}:{}: {}", file.string(), line, text));
  };
  if (!root.IsMap() && !root.IsNull()) add_problem(1, "'NAME: SCORE' lines are wanted");
  // Of anything but a map, iteration gives items without a key.
  for (const auto& item : root.IsMap() ? root : YAML::Node(YAML::NodeType::Map)) {
    const int line = item.first.Mark().line + 1;
    if (!item.first.IsScalar()) {
      add_problem(line, "a class name must be plain text");
      continue;
    }
    const std::string& name = item.first.Scalar();
    const auto [first, is_new] = first_lines.emplace(name, line);
    const std::optional<double> score = ParseScore(item.second);
    if (!is_new) {
      add_problem(line, fmt::format("{} is given a second time, first in line {}", name, first->second));
    } else if (!score) {
      add_problem(line, fmt::format("the score of {} must be a number from 0 (static) to {} (dynamic){}",
                                    name, DynamicPrior::kMaxScore,
                                    item.second.IsScalar() && !item.second.Scalar().empty()
                                        ? fmt::format(", is '{}'", item.second.Scalar())
                                        : ""));
    } else if (name == kOther) {
      prior.other_score = *score;
    } else {
      prior.score_of_class.emplace(name, *score);
    }
  }
  if (!first_lines.contains(kOther)) {
    problems.push_back(
        fmt::format("{}: '{}' is missing, the score of classes that are not there", file.string(), kOther));
  }
  if (!problems.empty()) {
    throw InputError(file.string(), fmt::format("cannot be used\n  {}", fmt::join(problems, "\n  ")),
                     "Correct the file and try again.");
  }
  return prior;
}

DynamicPrior LoadDynamicPrior(const std::string& name_or_path) {
  return ReadDynamicPrior(FindConfig("", "dynamic prior", name_or_path));
}

}  // namespace dynamic_slam
