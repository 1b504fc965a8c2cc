#pragma once

#include <compare>
#include <cstdint>
#include <limits>

namespace dynamic_slam {

// An index that cannot be confused with an index of another kind. Ids are dense, start at 0, grow in the
// order of creation, and are never reused, so iterating by id is iterating by age.
template <class Tag>
class Id {
 public:
  constexpr Id() = default;
  constexpr explicit Id(uint32_t value) : value_(value) {}

  constexpr uint32_t value() const { return value_; }
  constexpr bool IsValid() const { return value_ != kInvalid; }
  constexpr auto operator<=>(const Id&) const = default;

 private:
  static constexpr uint32_t kInvalid = std::numeric_limits<uint32_t>::max();
  uint32_t value_ = kInvalid;
};

using FrameId = Id<struct FrameTag>;
using KeyframeId = Id<struct KeyframeTag>;
using LandmarkId = Id<struct LandmarkTag>;
using PartId = Id<struct PartTag>;  // of the map (Map)

}  // namespace dynamic_slam
