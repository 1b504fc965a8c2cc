#pragma once

#include <algorithm>
#include <deque>
#include <utility>
#include <vector>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/semantics/box_compensation.h"

namespace dynamic_slam {

// A compensation whose whole memory is one value, `State`: what arrives late is put in its place, and the
// frames since are replayed from the state before it.
template <class State>
class ReplayingCompensation : public BoxCompensation {
 public:
  std::vector<CompensatedBox> Update(CompensationInput input) final {
    DS_CHECK(history_.empty() || history_.back().input.frame < input.frame, "frame {} does not follow {}",
             input.frame.value(), history_.back().input.frame.value());
    if (input.detections) input.detections = Usable(*input.detections);
    history_.push_back({std::move(input), state_});
    if (history_.size() > kHistoryFrames) history_.pop_front();
    Replay(history_.size() - 1);
    return Boxes();
  }

  bool UpdateLate(FrameId frame, std::span<const Detection> detections) final {
    const size_t at = Find(frame);
    if (at == history_.size()) return false;
    history_[at].input.detections = Usable(detections);
    Replay(at);
    return true;
  }

  bool UpdateRotation(FrameId frame, const Eigen::Quaterniond& cam_from_last) final {
    const size_t at = Find(frame);
    if (at == history_.size()) return false;
    history_[at].input.cam_from_last = cam_from_last;
    Replay(at);
    return true;
  }

  std::vector<CompensatedBox> Boxes() const final { return BoxesOf(state_); }

  std::vector<FrameBoxes> EarlierBoxes(FrameId first) const final {
    std::vector<FrameBoxes> earlier;
    for (size_t i = 0; i + 1 < history_.size(); ++i) {
      if (history_[i].input.frame < first) continue;
      earlier.push_back({history_[i].input.frame, BoxesOf(history_[i + 1].before)});
    }
    return earlier;
  }

  void Reset() final {
    history_.clear();
    state_ = State();
  }

 protected:
  virtual std::vector<Detection> Usable(std::span<const Detection> detections) const = 0;
  // Takes the state from the frame before to that of `input`, whose detections are Usable.
  virtual void Advance(const CompensationInput& input, State* state) = 0;
  virtual std::vector<CompensatedBox> BoxesOf(const State& state) const = 0;

  // Replayed frames draw new ids: an id that another object had for a moment is not used again.
  int NextTrackId() { return next_track_id_++; }

 private:
  struct Step {
    CompensationInput input;
    State before;
  };

  size_t Find(FrameId frame) const {
    const auto step =
        std::find_if(history_.begin(), history_.end(), [&](const Step& s) { return s.input.frame == frame; });
    return static_cast<size_t>(step - history_.begin());
  }

  void Replay(size_t first) {
    state_ = history_[first].before;
    for (size_t i = first; i < history_.size(); ++i) {
      history_[i].before = state_;
      Advance(history_[i].input, &state_);
    }
  }

  std::deque<Step> history_;  // oldest first
  State state_;               // after the last step
  int next_track_id_ = 0;
};

}  // namespace dynamic_slam
