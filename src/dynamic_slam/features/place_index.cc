#include "dynamic_slam/features/place_index.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

// Of one point seen twice, a test comes out differently in one case of eight, of two points in one of two.
// With these limits 40% of the points are known again, and one in 10^5 pairs of others is taken for one.
constexpr int kHalfBits = 16;
constexpr int kMaxDifferentBits = 5;

constexpr uint32_t kHalfMask = (1u << kHalfBits) - 1;

// From the first half of a word to the question's words that differ from it in at most one bit there.
class ProbeTable {
 public:
  explicit ProbeTable(std::span<const uint32_t> words) : first_(1u << kHalfBits, kNone) {
    probes_.reserve(words.size() * (kHalfBits + 1));
    for (uint32_t i = 0; i < words.size(); ++i) {
      Insert(words[i] & kHalfMask, i);
      for (int bit = 0; bit < kHalfBits; ++bit) Insert((words[i] ^ (1u << bit)) & kHalfMask, i);
    }
  }

  template <class Fn>
  void ForEach(uint32_t word, Fn&& fn) const {
    for (uint32_t i = first_[word & kHalfMask]; i != kNone; i = probes_[i].next) {
      if (fn(probes_[i].word)) return;
    }
  }

 private:
  static constexpr uint32_t kNone = 0xffffffffu;
  struct Probe {
    uint32_t word, next;
  };

  void Insert(uint32_t half, uint32_t word) {
    probes_.push_back({word, first_[half]});
    first_[half] = static_cast<uint32_t>(probes_.size() - 1);
  }

  std::vector<uint32_t> first_;
  std::vector<Probe> probes_;
};

}  // namespace

std::vector<uint32_t> PlaceWords(const FeatureSet& features, std::span<const float> static_probability,
                                 float min_static_probability) {
  std::vector<uint32_t> order;
  for (uint32_t i = 0; i < features.size(); ++i) {
    if (static_probability.empty() || static_probability[i] >= min_static_probability) order.push_back(i);
  }
  if (order.size() > PlaceIndex::kMaxWords) {
    const auto stronger = [&features](uint32_t a, uint32_t b) {
      const float response_a = features.keypoints[a].response, response_b = features.keypoints[b].response;
      return response_a != response_b ? response_a > response_b : a < b;
    };
    std::nth_element(order.begin(), order.begin() + PlaceIndex::kMaxWords, order.end(), stronger);
    order.resize(PlaceIndex::kMaxWords);
    std::sort(order.begin(), order.end());
  }
  std::vector<uint32_t> words;
  words.reserve(order.size());
  for (const uint32_t i : order) words.push_back(static_cast<uint32_t>(features.descriptors[i][0]));
  return words;
}

void PlaceIndex::Add(KeyframeId keyframe, std::vector<uint32_t> words) {
  DS_CHECK(WordsOf(keyframe).empty(), "keyframe {}", keyframe.value());
  if (words.empty()) return;
  if (words_.size() <= keyframe.value()) words_.resize(keyframe.value() + 1);
  words_[keyframe.value()] = std::move(words);
  ++size_;
}

void PlaceIndex::Erase(KeyframeId keyframe) {
  if (WordsOf(keyframe).empty()) return;
  std::vector<uint32_t>().swap(words_[keyframe.value()]);
  --size_;
}

void PlaceIndex::Clear() {
  words_.clear();
  size_ = 0;
}

const std::vector<uint32_t>& PlaceIndex::WordsOf(KeyframeId keyframe) const {
  static const std::vector<uint32_t> kNone;
  return keyframe.value() < words_.size() ? words_[keyframe.value()] : kNone;
}

DS_DISPATCH_POPCNT
std::vector<PlaceMatch> PlaceIndex::Query(std::span<const uint32_t> words) const {
  std::vector<PlaceMatch> matches;
  if (words.empty() || size_ == 0) return matches;
  const ProbeTable table(words);
  std::vector<uint32_t> shared;  // words of the question, those of each match one after the other
  std::vector<uint32_t> keyframes_with(words.size(), 0);
  std::vector<uint32_t> last_keyframe_with(words.size(), KeyframeId().value());
  for (uint32_t keyframe = 0; keyframe < words_.size(); ++keyframe) {
    const size_t begin = shared.size();
    for (const uint32_t word : words_[keyframe]) {
      table.ForEach(word, [&](uint32_t asked) {
        if (last_keyframe_with[asked] == keyframe || std::popcount(word ^ words[asked]) > kMaxDifferentBits)
          return false;
        last_keyframe_with[asked] = keyframe;
        ++keyframes_with[asked];
        shared.push_back(asked);
        return true;
      });
    }
    if (shared.size() > begin) {
      matches.push_back({KeyframeId(keyframe), static_cast<int>(shared.size() - begin), 0});
    }
  }
  const double all = static_cast<double>(size_) + 1;
  size_t next = 0;
  for (PlaceMatch& match : matches) {
    for (int i = 0; i < match.words; ++i) match.score += std::log(all / keyframes_with[shared[next++]]);
    match.score /= std::log(all) * static_cast<double>(words.size());
  }
  std::sort(matches.begin(), matches.end(), [](const PlaceMatch& a, const PlaceMatch& b) {
    return a.score != b.score ? a.score > b.score : a.keyframe > b.keyframe;
  });
  return matches;
}

size_t PlaceIndex::MemoryBytes() const {
  return std::accumulate(words_.begin(), words_.end(), sizeof(*this) + words_.capacity() * sizeof(words_[0]),
                         [](size_t sum, const std::vector<uint32_t>& words) {
                           return sum + words.capacity() * sizeof(uint32_t);
                         });
}

}  // namespace dynamic_slam
