#include "dynamic_slam/features/place_index.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

constexpr int kQuarters = 4, kQuarterBits = 16;
// One less than twice the number of quarters: what differs in no more than that has a quarter that differs in
// one.
constexpr int kMaxDifferentBits = 2 * kQuarters - 1;

// From the quarters of a word to the question's words that differ from it in at most one bit of the same
// quarter.
class ProbeTable {
 public:
  explicit ProbeTable(std::span<const uint64_t> words) : first_(kQuarters << kQuarterBits, kNone) {
    DS_CHECK(words.size() <= PlaceIndex::kMaxWords, "{} words", words.size());
    probes_.reserve(words.size() * kQuarters * (kQuarterBits + 1));
    for (uint16_t i = 0; i < words.size(); ++i) {
      for (int quarter = 0; quarter < kQuarters; ++quarter) {
        const uint32_t slot = Slot(words[i], quarter);
        Insert(slot, i);
        for (int bit = 0; bit < kQuarterBits; ++bit) Insert(slot ^ (1u << bit), i);
      }
    }
  }

  // Calls fn for the words, some of them more than once, until it says that this is enough.
  template <class Fn>
  void ForEach(uint64_t word, Fn&& fn) const {
    for (int quarter = 0; quarter < kQuarters; ++quarter) {
      for (uint16_t i = first_[Slot(word, quarter)]; i != kNone; i = probes_[i].next) {
        if (fn(probes_[i].word)) return;
      }
    }
  }

 private:
  static constexpr uint16_t kNone = 0xffff;
  static_assert(PlaceIndex::kMaxWords * kQuarters * (kQuarterBits + 1) < kNone);
  struct Probe {
    uint16_t word, next;
  };

  static uint32_t Slot(uint64_t word, int quarter) {
    const uint64_t part = (word >> (quarter * kQuarterBits)) & ((1u << kQuarterBits) - 1);
    return static_cast<uint32_t>(quarter) << kQuarterBits | static_cast<uint32_t>(part);
  }

  void Insert(uint32_t slot, uint16_t word) {
    probes_.push_back({word, first_[slot]});
    first_[slot] = static_cast<uint16_t>(probes_.size() - 1);
  }

  std::vector<uint16_t> first_;
  std::vector<Probe> probes_;
};

}  // namespace

std::vector<uint64_t> PlaceWords(const FeatureSet& features, std::span<const float> static_probability,
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
  std::vector<uint64_t> words;
  words.reserve(order.size());
  for (const uint32_t i : order) words.push_back(features.descriptors[i][0]);
  return words;
}

void PlaceIndex::Add(KeyframeId keyframe, std::vector<uint64_t> words) {
  DS_CHECK(WordsOf(keyframe).empty(), "keyframe {}", keyframe.value());
  if (words.empty()) return;
  if (words_.size() <= keyframe.value()) words_.resize(keyframe.value() + 1);
  words_[keyframe.value()] = std::move(words);
  ++size_;
}

void PlaceIndex::Erase(KeyframeId keyframe) {
  if (WordsOf(keyframe).empty()) return;
  std::vector<uint64_t>().swap(words_[keyframe.value()]);
  --size_;
}

void PlaceIndex::Clear() {
  words_.clear();
  size_ = 0;
}

const std::vector<uint64_t>& PlaceIndex::WordsOf(KeyframeId keyframe) const {
  static const std::vector<uint64_t> kNone;
  return keyframe.value() < words_.size() ? words_[keyframe.value()] : kNone;
}

DS_DISPATCH_POPCNT
std::vector<PlaceMatch> PlaceIndex::Query(std::span<const uint64_t> words) const {
  std::vector<PlaceMatch> matches;
  if (words.empty() || size_ == 0) return matches;
  const ProbeTable table(words);
  std::vector<uint32_t> shared;  // words of the question, those of each match one after the other
  std::vector<uint32_t> keyframes_with(words.size(), 0);
  std::vector<uint32_t> last_keyframe_with(words.size(), KeyframeId().value());
  for (uint32_t keyframe = 0; keyframe < words_.size(); ++keyframe) {
    const size_t begin = shared.size();
    for (const uint64_t word : words_[keyframe]) {
      table.ForEach(word, [&](uint16_t asked) {
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
                         [](size_t sum, const std::vector<uint64_t>& words) {
                           return sum + words.capacity() * sizeof(uint64_t);
                         });
}

}  // namespace dynamic_slam
