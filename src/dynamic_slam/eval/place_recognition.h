#pragma once

#include <optional>
#include <vector>

namespace dynamic_slam {

// One question of where an image was taken, and the best answer.
struct PlaceAnswer {
  enum class Truth { kRight, kWrong, kUnclear };

  bool has_place = false;  // there is a right answer that must be found; others may be right too
  // None when nothing looks like it.
  std::optional<double> score;
  Truth truth = Truth::kUnclear;  // of the answer; unclear ones are neither right nor wrong
};

// Answers with at least this score.
struct PrecisionRecall {
  double min_score = 0;
  double precision = 0;  // right ones over those that are right or wrong
  double recall = 0;     // of the questions that have a right answer, those that got one
};

// One point for each score, from the highest to the lowest. Empty when no question has a right answer.
std::vector<PrecisionRecall> PrecisionRecallCurve(const std::vector<PlaceAnswer>& answers);

// The highest recall at which no answer is wrong; 0 when there is none.
double RecallAtFullPrecision(const std::vector<PrecisionRecall>& curve);

}  // namespace dynamic_slam
