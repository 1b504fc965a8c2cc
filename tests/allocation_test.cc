// Tracking a frame asks for no memory, but when a buffer grows with the map; a program of its own, as it
// takes malloc's place.

#include <algorithm>
#include <cstdlib>
#include <vector>

#include <gtest/gtest.h>

#include "dynamic_slam/mapping/local_mapper.h"
#include "dynamic_slam/sim/room.h"
#include "dynamic_slam/system/system_options.h"
#include "dynamic_slam/tracking/tracker.h"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define DS_CAN_COUNT 1

namespace {
thread_local size_t allocations = 0;
}

extern "C" {
void* __libc_malloc(size_t bytes);                      // NOLINT
void* __libc_calloc(size_t count, size_t bytes);        // NOLINT
void* __libc_realloc(void* old, size_t bytes);          // NOLINT
void* __libc_memalign(size_t alignment, size_t bytes);  // NOLINT

void* malloc(size_t bytes) {
  ++allocations;
  return __libc_malloc(bytes);
}
void* calloc(size_t count, size_t bytes) {
  ++allocations;
  return __libc_calloc(count, bytes);
}
void* realloc(void* old, size_t bytes) {
  ++allocations;
  return __libc_realloc(old, bytes);
}
void* memalign(size_t alignment, size_t bytes) {
  ++allocations;
  return __libc_memalign(alignment, bytes);
}
void* aligned_alloc(size_t alignment, size_t bytes) { return memalign(alignment, bytes); }
int posix_memalign(void** result, size_t alignment, size_t bytes) {
  *result = memalign(alignment, bytes);
  return *result == nullptr;
}
}
#endif

namespace dynamic_slam {
namespace {

#ifdef DS_CAN_COUNT

struct Count {
  size_t frames = 0, frames_with_some = 0, allocations = 0;
};

// Of the frames that make no keyframe.
Count CountInRoom() {
  RoomOptions room_options;
  room_options.frames = 150;
  const Room room(room_options);
  const SystemOptions options;
  const Camera& camera = room_options.camera;
  SharedMap map(OctaveScales(options.orb));
  Tracker tracker(camera, options.orb, options.tracker, options.dynamic, options.seed, &map);
  LocalMapper mapper(camera, options.mapper, &map);
  constexpr int kWarmUp = 60;
  Count count;
  for (int i = 0; i < room_options.frames; ++i) {
    const cv::Mat image = room.Frame(i);
    const size_t before = allocations;
    tracker.Extract(FrameId(static_cast<uint32_t>(i)), room.truth()[static_cast<size_t>(i)].timestamp_s,
                    image, {});
    const TrackingResult result = tracker.Track();
    const size_t now = allocations - before;
    for (const KeyframeId keyframe : result.new_keyframes) mapper.Process(keyframe, result.map_epoch);
    if (i < kWarmUp || result.state != TrackingState::kTracking || !result.new_keyframes.empty()) continue;
    ++count.frames;
    count.frames_with_some += now > 0;
    count.allocations += now;
  }
  return count;
}

TEST(AllocationTest, TheCountCounts) {
  const size_t before = allocations;
  std::vector<int>* volatile made = new std::vector<int>(100);
  delete made;
  EXPECT_EQ(allocations - before, 2u);
}

// Each buffer that is as large as the part of the map in view doubles now and then.
void ExpectOnlyGrowth(const Count& count) {
  EXPECT_GT(count.frames, 50u);
  EXPECT_LE(count.allocations, 24u) << count.frames_with_some << " of " << count.frames << " frames";
  EXPECT_LE(8 * count.frames_with_some, count.frames);
}

TEST(AllocationTest, TrackingNeedsNone) { ExpectOnlyGrowth(CountInRoom()); }

#else
TEST(AllocationTest, TrackingNeedsNone) { GTEST_SKIP() << "another malloc than glibc's, or a sanitizer's"; }
#endif

}  // namespace
}  // namespace dynamic_slam
