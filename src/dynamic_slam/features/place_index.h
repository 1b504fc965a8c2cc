#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/features/features.h"

namespace dynamic_slam {

// The words of an image: the first quarter of the descriptors of its strongest keypoints, those that are
// likely enough at rest. static_probability: of each keypoint, or empty.
std::vector<uint64_t> PlaceWords(const FeatureSet& features, std::span<const float> static_probability,
                                 float min_static_probability);

// How much a keyframe looks like the image that was asked about.
struct PlaceMatch {
  KeyframeId keyframe;
  int words = 0;     // of the image that the keyframe has too
  double score = 0;  // the same weighed by how rare each is, 0 to 1
};

// Knows places again by what they look like. Starts empty and learns nothing: a keyframe is a list of words,
// and two words are one when they differ in at most 7 of their 64 bits. Then one of their quarters differs in
// at most one bit, so a question makes tables of the quarters of its words with each bit turned over in turn,
// and runs the words of all keyframes through them: a few microseconds for each.
//
// Words are rare or common in the keyframes that there are (inverse document frequency; Galvez-Lopez and
// Tardos, "Bags of binary words for fast place recognition in image sequences", 2012). Answers depend on
// nothing but what was added and erased.
class PlaceIndex {
 public:
  static constexpr size_t kMaxWords = 240;  // 8 bytes each: less than 2 kB a keyframe

  void Add(KeyframeId keyframe, std::vector<uint64_t> words);
  void Erase(KeyframeId keyframe);  // nothing happens when it is not there
  void Clear();

  // The keyframes that share words with the image, best first, among equals the younger.
  std::vector<PlaceMatch> Query(std::span<const uint64_t> words) const;

  const std::vector<uint64_t>& WordsOf(KeyframeId keyframe) const;  // empty when it is not there
  size_t size() const { return size_; }                             // keyframes
  size_t MemoryBytes() const;

 private:
  std::vector<std::vector<uint64_t>> words_;  // by keyframe id
  size_t size_ = 0;
};

}  // namespace dynamic_slam
