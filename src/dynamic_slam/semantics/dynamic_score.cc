#include "dynamic_slam/semantics/dynamic_score.h"

#include <cmath>
#include <utility>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/semantics/dynamic_prior.h"

namespace dynamic_slam {

DynamicScore::DynamicScore(const DynamicScoreOptions& options, std::vector<double> class_scores)
    : options_(options), class_scores_(std::move(class_scores)) {
  for (const double score : class_scores_) {
    DS_CHECK(score >= 0 && score <= DynamicPrior::kMaxScore, "score={}", score);
  }
}

DynamicScore::Track DynamicScore::Begin(int class_id) const {
  Track track;
  track.belief.assign(class_scores_.size(), 0.0);
  track.belief[static_cast<size_t>(class_id)] = 1;
  Predict(&track.belief);
  return track;
}

void DynamicScore::Predict(std::vector<double>* belief) const {
  const double q = options_.swap_probability;
  for (double& b : *belief) b = (1 - q) * b + q / static_cast<double>(belief->size());
}

void DynamicScore::Measure(int class_id, double trust, std::vector<double>* belief) const {
  (*belief)[static_cast<size_t>(class_id)] *= std::exp(trust * options_.label_evidence);
  double sum = 0;
  for (const double b : *belief) sum += b;
  for (double& b : *belief) b /= sum;
}

std::vector<DynamicBox> DynamicScore::Update(std::span<const CompensatedBox> boxes) {
  ++frame_;
  std::vector<DynamicBox> result;
  for (const CompensatedBox& box : boxes) {
    DS_CHECK(box.class_id >= 0 && static_cast<size_t>(box.class_id) < class_scores_.size(), "class_id={}",
             box.class_id);
    DS_CHECK(box.score >= 0 && box.score <= 1, "score={}", box.score);
    const auto [found, is_new] = tracks_.try_emplace(box.track_id);
    Track& track = found->second;
    const int detection = frame_ - box.missed_frames;
    if (is_new) {
      track = Begin(box.class_id);
      track.last_detection = detection;
    } else if (detection > track.last_detection) {
      Predict(&track.belief);
      Measure(box.class_id, box.score, &track.belief);
      track.last_detection = detection;
    }
    track.last_frame = frame_;
    result.push_back(Judge(box, track));
  }
  std::erase_if(tracks_, [this](const auto& item) {
    return frame_ - item.second.last_frame >= static_cast<int>(BoxCompensation::kHistoryFrames);
  });
  return result;
}

DynamicBox DynamicScore::Judge(const CompensatedBox& box, const Track& track) const {
  double score = 0;
  for (size_t i = 0; i < class_scores_.size(); ++i) score += track.belief[i] * class_scores_[i];
  return {{box}, score / DynamicPrior::kMaxScore, score, score > options_.threshold};
}

DynamicBox DynamicScore::Judge(const CompensatedBox& box) const {
  const auto known = tracks_.find(box.track_id);
  return Judge(box, known != tracks_.end() ? known->second : Begin(box.class_id));
}

void DynamicScore::Reset() { tracks_.clear(); }

}  // namespace dynamic_slam
