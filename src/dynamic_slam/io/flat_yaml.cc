#include "dynamic_slam/io/flat_yaml.h"

#include <cmath>
#include <optional>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

std::optional<double> FiniteNumber(const YAML::Node& node) {
  const std::optional<double> number = node.IsScalar() ? ParseDouble(node.Scalar()) : std::nullopt;
  return number && std::isfinite(*number) ? number : std::nullopt;
}

}  // namespace

FlatYaml::FlatYaml(const std::filesystem::path& file) : file_(file) {
  constexpr char kRemedy[] = "Check that this is the calibration file, and that it is whole.";
  std::string text = ReadFile(file, "Check the path.");
  // OpenCV writes "%YAML:1.0", which is no YAML directive; a byte order mark may stand before it.
  if (const size_t at = text.find("%YAML:"); at <= 3) text[at] = '#';
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& e) {
    const std::string where =
        e.mark.line >= 0 ? fmt::format("{}:{}", file.string(), e.mark.line + 1) : file.string();
    throw InputError(where, fmt::format("is not YAML: {}", e.msg), kRemedy);
  }
  if (!root.IsMap()) throw InputError(file.string(), "'key: value' lines are wanted", kRemedy);

  const auto add = [this](const std::string& key, const YAML::Node& key_node, const YAML::Node& value) {
    const int line = key_node.Mark().line + 1;
    const auto [first, is_new] = lines_.emplace(key, line);
    if (is_new) {
      entries_.emplace(key, value);
    } else {
      problems_.push_back(fmt::format("{}:{}: {} is given a second time, first in line {}", file_.string(),
                                      line, key, first->second));
    }
  };
  for (const auto& item : root) {
    if (!item.first.IsScalar()) continue;
    const std::string& name = item.first.Scalar();
    if (!item.second.IsMap()) {
      add(name, item.first, item.second);
      continue;
    }
    for (const auto& inner : item.second) {
      if (inner.first.IsScalar()) add(name + "." + inner.first.Scalar(), inner.first, inner.second);
    }
  }
}

bool FlatYaml::HasSection(const std::string& section) const {
  const auto found = entries_.lower_bound(section + ".");
  return found != entries_.end() && found->first.starts_with(section + ".");
}

std::string FlatYaml::Where(const std::string& key) const {
  const auto found = lines_.find(key);
  return found == lines_.end() ? file_.string() : fmt::format("{}:{}", file_.string(), found->second);
}

std::string FlatYaml::Word(const std::string& key) const {
  const auto found = entries_.find(key);
  return found != entries_.end() && found->second.IsScalar() ? found->second.Scalar() : std::string();
}

double FlatYaml::Number(const std::string& key) {
  const auto found = entries_.find(key);
  if (found == entries_.end()) {
    AddProblem(key, fmt::format("the key '{}' is missing", key));
    return 0;
  }
  const std::optional<double> number = FiniteNumber(found->second);
  if (!number) AddProblem(key, fmt::format("{} must be a finite number, is '{}'", key, Word(key)));
  return number.value_or(0);
}

std::vector<double> FlatYaml::Numbers(const std::string& key, size_t count) {
  std::vector<double> numbers;
  bool all_finite = true;
  if (const auto found = entries_.find(key); found != entries_.end() && found->second.IsSequence()) {
    for (const auto& item : found->second) {
      const std::optional<double> number = FiniteNumber(item);
      all_finite = all_finite && number;
      numbers.push_back(number.value_or(0));
    }
  }
  if (numbers.size() == count && all_finite) return numbers;
  AddProblem(key, fmt::format("'{}' with {} numbers is wanted", key, count));
  return std::vector<double>(count);
}

void FlatYaml::AddProblem(const std::string& key, std::string_view text) {
  problems_.push_back(fmt::format("{}: {}", Where(key), text));
}

void FlatYaml::ThrowProblems(const std::string& remedy) const {
  if (problems_.empty()) return;
  const std::string count =
      problems_.size() == 1 ? "1 problem" : fmt::format("{} problems", problems_.size());
  throw InputError(file_.string(), fmt::format("{}\n  {}", count, fmt::join(problems_, "\n  ")), remedy);
}

}  // namespace dynamic_slam
