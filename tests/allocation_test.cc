// Tracking a frame asks for no memory, but when a buffer grows with the map; a program of its own, as it
// takes malloc's place.

#include <algorithm>
#include <cstdlib>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

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
  int culled = 0;  // keypoints
};

// Something with a texture of its own that crosses the image to and fro, one box about it.
class Passer {
 public:
  Passer() : texture_(300, 120, CV_8UC1) {
    cv::RNG random(1);
    random.fill(texture_, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(texture_, texture_, {}, 1.5);
  }

  // Draws itself into frame i and says where it is.
  DynamicBox Draw(int i, cv::Mat* image) const {
    const int range = image->cols - texture_.cols, step_px = 4;
    const int phase = step_px * i % (2 * range);
    const cv::Rect place(phase < range ? phase : 2 * range - phase, 90, texture_.cols, texture_.rows);
    texture_.copyTo((*image)(place));
    DynamicBox box;
    box.track_id = 1;
    box.box = {double(place.x), double(place.y), double(place.width), double(place.height)};
    box.probability = 0.9;
    box.dynamic_score = 9;
    box.is_dynamic = true;
    return box;
  }

 private:
  cv::Mat texture_;
};

// Of the frames that make no keyframe. readout_s: the room's shutter does not roll, but its camera says so.
Count CountInRoom(const Passer* passer, double readout_s = 0) {
  RoomOptions room_options;
  room_options.frames = 150;
  const Room room(room_options);
  const SystemOptions options;
  Camera camera = room_options.camera;
  camera.readout_s = readout_s;
  SharedMap map(OctaveScales(options.orb));
  Tracker tracker(camera, options.orb, options.tracker, options.dynamic, options.seed, &map);
  LocalMapper mapper(camera, options.mapper, &map);
  constexpr int kWarmUp = 60;
  Count count;
  for (int i = 0; i < room_options.frames; ++i) {
    cv::Mat image = room.Frame(i);
    FrameObjects objects;
    if (passer != nullptr) objects.boxes.push_back(passer->Draw(i, &image));
    const size_t before = allocations;
    tracker.Extract(FrameId(static_cast<uint32_t>(i)), room.truth()[static_cast<size_t>(i)].timestamp_s,
                    image, {});
    const TrackingResult result = tracker.Track(objects);
    const size_t now = allocations - before;
    for (const KeyframeId keyframe : result.new_keyframes) mapper.Process(keyframe, result.map_epoch);
    if (i < kWarmUp || result.state != TrackingState::kTracking || !result.new_keyframes.empty()) continue;
    ++count.frames;
    count.culled += result.dynamic.culled;
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

TEST(AllocationTest, TrackingNeedsNone) { ExpectOnlyGrowth(CountInRoom(nullptr)); }

TEST(AllocationTest, ARollingShutterNeedsNone) { ExpectOnlyGrowth(CountInRoom(nullptr, 0.001)); }

TEST(AllocationTest, TrackingAMoverNeedsNone) {
  const Passer passer;
  const Count count = CountInRoom(&passer);
  EXPECT_GT(count.culled, 1000) << "of what moves";
  ExpectOnlyGrowth(count);
}

#else
TEST(AllocationTest, TrackingNeedsNone) { GTEST_SKIP() << "another malloc than glibc's, or a sanitizer's"; }
#endif

}  // namespace
}  // namespace dynamic_slam
