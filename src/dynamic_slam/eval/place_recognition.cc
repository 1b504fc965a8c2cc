#include "dynamic_slam/eval/place_recognition.h"

#include <algorithm>

namespace dynamic_slam {

std::vector<PrecisionRecall> PrecisionRecallCurve(const std::vector<PlaceAnswer>& answers) {
  std::vector<PlaceAnswer> given;
  double places = 0;
  for (const PlaceAnswer& answer : answers) {
    places += answer.has_place;
    if (answer.score.has_value() && answer.truth != PlaceAnswer::Truth::kUnclear) given.push_back(answer);
  }
  std::vector<PrecisionRecall> curve;
  if (places == 0) return curve;
  std::sort(given.begin(), given.end(),
            [](const PlaceAnswer& a, const PlaceAnswer& b) { return *a.score > *b.score; });
  double right = 0, found = 0, all = 0;
  for (size_t i = 0; i < given.size(); ++i) {
    ++all;
    right += given[i].truth == PlaceAnswer::Truth::kRight;
    found += given[i].truth == PlaceAnswer::Truth::kRight && given[i].has_place;
    // Equal scores cannot be told apart.
    if (i + 1 < given.size() && *given[i + 1].score == *given[i].score) continue;
    curve.push_back({*given[i].score, right / all, found / places});
  }
  return curve;
}

double RecallAtFullPrecision(const std::vector<PrecisionRecall>& curve) {
  double recall = 0;
  for (const PrecisionRecall& point : curve) {
    if (point.precision < 1) break;
    recall = point.recall;
  }
  return recall;
}

}  // namespace dynamic_slam
