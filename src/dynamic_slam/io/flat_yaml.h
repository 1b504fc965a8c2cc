#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <yaml-cpp/yaml.h>

namespace dynamic_slam {

// A YAML file that another program wrote, OpenCV's "%YAML:1.0" included. A key of a section is the same
// nested
// ("Camera:" with "fx: 500" below it) and flat ("Camera.fx: 500"): "Camera.fx". Collects what is wrong with
// what is asked of it, to be reported together.
class FlatYaml {
 public:
  // Throws InputError when the file cannot be read or is no YAML of 'key: value' lines.
  explicit FlatYaml(const std::filesystem::path& file);

  const std::filesystem::path& file() const { return file_; }

  bool Has(const std::string& key) const { return entries_.contains(key); }

  // Whether there is a key "section.something".
  bool HasSection(const std::string& section) const;

  // "FILE:LINE" of the key; "FILE" without it.
  std::string Where(const std::string& key) const;

  // The value as text; "" when there is none.
  std::string Word(const std::string& key) const;

  // The value as a finite number. Otherwise, and when the key is absent: a problem, and 0.
  double Number(const std::string& key);

  // `count` finite numbers "[a, b, c]"; otherwise a problem, and zeros.
  std::vector<double> Numbers(const std::string& key, size_t count);

  // Notes "FILE:LINE: text", with the line of the key.
  void AddProblem(const std::string& key, std::string_view text);

  // Throws InputError with all problems, if there are any.
  void ThrowProblems(const std::string& remedy) const;

 private:
  std::filesystem::path file_;
  std::map<std::string, YAML::Node> entries_;
  std::map<std::string, int> lines_;
  std::vector<std::string> problems_;
};

}  // namespace dynamic_slam
