#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dynamic_slam {

// How dynamic the objects of each class are by experience (section 3.2 and Fig. 4): scores from 0 (static) to
// kMaxScore (dynamic). Classes go by name, as each detector numbers them in its own way; a name in capitals
// also by that in lower case.
struct DynamicPrior {
  static constexpr double kMaxScore = 10;

  std::map<std::string, double, std::less<>> score_of_class;
  double other_score = 0;  // of a class without a score of its own

  double Score(std::string_view class_name) const;
};

// The score of each of a detector's classes, by class id.
std::vector<double> ClassScores(const DynamicPrior& prior, std::span<const std::string> class_names);

// Reads lines NAME: SCORE (YAML); the name `other` gives the score of all classes that are not there. Throws
// InputError that lists every problem with file:line: no YAML, no number from 0 to 10, a class given twice,
// `other` missing.
DynamicPrior ReadDynamicPrior(const std::filesystem::path& file);

// The same of a file, or of a name in the configuration's folder: "dynamic_prior" comes with the program.
// Throws InputError, also when there is no such file or name.
DynamicPrior LoadDynamicPrior(const std::string& name_or_path);

}  // namespace dynamic_slam
