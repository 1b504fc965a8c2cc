#pragma once

#include <cstdint>
#include <vector>

#include "dynamic_slam/base/ids.h"

namespace dynamic_slam {

// Which landmark another was merged into, for as long as somebody may hold the old id: frames, keyframes on
// their way and loops being closed. A merge is forgotten when one of a landmark made 32,768 landmarks later,
// minutes of driving, takes its place: a map that runs for days does not grow by it.
class MergeLog {
 public:
  void Add(LandmarkId from, LandmarkId into) {
    if (merges_.empty()) merges_.resize(kSize);
    merges_[from.value() % kSize] = {from, into};
  }

  // Not valid when the landmark was not merged, or long ago.
  LandmarkId Into(LandmarkId from) const {
    if (merges_.empty()) return {};
    const Merge& merge = merges_[from.value() % kSize];
    return merge.from == from ? merge.into : LandmarkId();
  }

 private:
  static constexpr uint32_t kSize = 1 << 15;

  struct Merge {
    LandmarkId from, into;
  };

  std::vector<Merge> merges_;  // by the id of `from` modulo kSize
};

}  // namespace dynamic_slam
