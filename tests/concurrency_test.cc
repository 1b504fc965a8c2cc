// Interleavings of the stages, drawn by seed: what is wrong between two looks at the map comes out here.

#include <cstdlib>
#include <cstring>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/loop/two_visits.h"
#include "dynamic_slam/mapping/local_mapper.h"
#include "dynamic_slam/mapping/map_bundle.h"
#include "dynamic_slam/system/slam_system.h"
#include "dynamic_slam/tracking/tracker.h"
#include "shuffled_executor.h"
#include "small_room.h"
#include "whole_run.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;

constexpr uint64_t kSeeds = 200;
constexpr uint64_t kShards = 8;

uint64_t NumberOr(const char* variable, uint64_t usual) {
  const char* const wish = std::getenv(variable);
  return wish == nullptr ? usual : std::strtoull(wish, nullptr, 10);
}

// Up to that of DYNAMIC_SLAM_SEEDS, for a long search, and from that of DYNAMIC_SLAM_FIRST_SEED, for one seed
// again.
uint64_t SeedsOr(uint64_t usual) { return NumberOr("DYNAMIC_SLAM_SEEDS", usual); }
uint64_t FirstSeed() { return NumberOr("DYNAMIC_SLAM_FIRST_SEED", 0); }

// Whether there are enough of them for all that may happen to have happened.
bool IsSearch() { return FirstSeed() + kSeeds <= SeedsOr(kSeeds); }

// What happens in the middle of a run.
enum class Event { kNone, kReset, kLoss, kStop };

SystemOptions RunOptions() {
  SystemOptions options = SmallRoom::CheapOptions();
  // Every loss ends the map, also of a map that mapping is busy with.
  options.tracker.small_map_keyframes = 1000;
  options.tracker.restart_after_frames = 2;
  return options;
}

template <class T>
void AppendBytes(const T& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

void AppendBytes(const Trajectory& trajectory, std::string* bytes) {
  for (const StampedPose& pose : trajectory) {
    AppendBytes(pose.timestamp_s, bytes);
    for (const double x : pose.world_from_cam.translation) AppendBytes(x, bytes);
    for (const double x : pose.world_from_cam.rotation.coeffs()) AppendBytes(x, bytes);
  }
}

// All that a run has made, bit by bit.
std::string Bytes(const SlamSystem& system) {
  std::string bytes;
  AppendBytes(system.FrameTrajectory(), &bytes);
  AppendBytes(system.KeyframeTrajectory(), &bytes);
  system.map().Read()->landmarks().ForEach([&bytes](const Landmark& landmark) {
    AppendBytes(landmark.id().value(), &bytes);
    for (const double x : landmark.position()) AppendBytes(x, &bytes);
    for (const Observation& observation : landmark.observations()) {
      AppendBytes(observation.keyframe.value(), &bytes);
      AppendBytes(observation.keypoint, &bytes);
    }
  });
  return bytes;
}

struct ShuffledRun {
  std::vector<std::string> problems;  // of the map
  Trajectory trajectory, truth;
  MappingReport mapping;
  size_t expected = 0;  // frames of the last map, if it begins with the film
  std::string bytes;
  std::vector<int> decisions;
};

ShuffledRun RunShuffled(uint64_t seed, Event event) {
  const SmallRoom& room = SmallRoom::Get();
  auto executor = std::make_unique<ShuffledExecutor>(seed);
  const ShuffledExecutor& shuffled = *executor;
  SlamSystem system(SmallRoom::SmallCamera(), RunOptions(), RunMode::kRealtime, std::move(executor));
  Random random(seed);
  ShuffledRun run;
  const auto process = [&](const cv::Mat& image, const Rigid3& world_from_cam) {
    run.truth.push_back({static_cast<double>(run.truth.size()) / 10, world_from_cam});
    system.Process(run.truth.back().timestamp_s, image);
  };
  const auto play = [&](size_t frames) {
    for (size_t i = 0; i < frames; ++i) process(room.images[i], room.room.truth()[i].world_from_cam);
    run.expected = frames;
  };
  // The map is made by the first of these, and mapping is busy with it.
  const size_t when = 7 + random.Index(9);
  play(event == Event::kNone ? room.images.size() : when);
  if (event == Event::kLoss) {
    for (int i = 0; i < 3; ++i) process(SmallRoom::NoiseImage(i), Rigid3());
  }
  if (event == Event::kReset) system.Reset();
  if (event == Event::kLoss || event == Event::kReset) play(20);
  if (event == Event::kStop) {
    system.Stop();
    EXPECT_THROW(system.Process(99, room.images[0]), InternalError);
  }
  system.Finish();
  run.problems = system.map().Read()->Validate();
  run.trajectory = system.FrameTrajectory();
  run.mapping = system.mapping_report();
  run.bytes = Bytes(system);
  run.decisions = shuffled.Decisions();
  return run;
}

class ShuffledTest : public ::testing::TestWithParam<uint64_t> {};

TEST_P(ShuffledTest, EveryOrderOfTheStagesGivesAValidMapAndTheRightPath) {
  const Trajectory& truth = SmallRoom::Get().room.truth();
  int abandoned = 0, stopped = 0;
  for (uint64_t seed = GetParam(); seed < SeedsOr(kSeeds); seed += kShards) {
    if (seed < FirstSeed()) continue;
    const Event event = static_cast<Event>((seed / kShards) % 4);
    SCOPED_TRACE(fmt::format("seed {} event {}", seed, static_cast<int>(event)));
    ShuffledRun run;
    ASSERT_NO_THROW(run = RunShuffled(seed, event));
    EXPECT_THAT(run.problems, IsEmpty());
    for (const StampedPose& pose : run.trajectory) ASSERT_TRUE(pose.world_from_cam.IsFinite());
    EXPECT_GE(run.trajectory.size(), 0.8 * static_cast<double>(run.expected));
    EXPECT_LE(run.trajectory.size(), run.expected);
    EXPECT_LE(ApeRmse(run.truth, run.trajectory), 0.04 * PathLength(ToPoseList(truth)));
    abandoned += run.mapping.keyframes_abandoned;
    stopped += run.mapping.bundles_stopped;
  }
  if (!IsSearch()) return;
  EXPECT_GT(abandoned, 0) << "no map was given up while mapping was busy with it";
  EXPECT_GT(stopped, 0) << "no bundle adjustment was interrupted";
}

INSTANTIATE_TEST_SUITE_P(Shards, ShuffledTest, ::testing::Range<uint64_t>(0, kShards));

TEST(ShuffledExecutorTest, TheSameSeedGivesTheSameBytes) {
  for (const Event event : {Event::kNone, Event::kLoss}) {
    const ShuffledRun first = RunShuffled(7, event), second = RunShuffled(7, event);
    EXPECT_GT(first.bytes.size(), 1000u);
    EXPECT_TRUE(first.bytes == second.bytes);
    EXPECT_EQ(first.decisions, second.decisions);
  }
}

TEST(ShuffledExecutorTest, OtherSeedsGiveOtherOrders) {
  std::set<std::vector<int>> decisions;
  std::set<std::string> results;
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const ShuffledRun run = RunShuffled(seed, Event::kNone);
    EXPECT_THAT(run.decisions, testing::AllOf(testing::Contains(0), testing::Contains(1)));
    decisions.insert(run.decisions);
    results.insert(run.bytes);
  }
  EXPECT_EQ(decisions.size(), 5u);
  EXPECT_GT(results.size(), 1u) << "the order matters to the result, or nothing was shuffled";
}

TEST(ShuffledExecutorTest, KeepsTheContractOfExecutors) {
  ShuffledExecutor executor(1);
  std::vector<int> done;
  for (int i = 0; i < 3; ++i) {
    executor.Post(Lane::kMapping, [&done, i](const std::stop_token&) { done.push_back(i); });
  }
  executor.Drain(Lane::kMapping);
  EXPECT_THAT(done, testing::ElementsAre(0, 1, 2));

  executor.Post(Lane::kMapping, [](const std::stop_token& token) {
    while (!token.stop_requested()) SchedulePoint();
  });
  executor.Post(Lane::kMapping, [&done](const std::stop_token&) { done.push_back(3); });
  executor.Cancel();
  EXPECT_EQ(executor.Waiting(Lane::kMapping), 0);
  EXPECT_EQ(done.size(), 3u);

  const auto fail = [](const std::stop_token&) { throw std::runtime_error("disk full"); };
  executor.Post(Lane::kMapping, fail);
  EXPECT_THROW(executor.Drain(Lane::kMapping), std::runtime_error);
  EXPECT_THROW(executor.Post(Lane::kMapping, fail), std::runtime_error);
  executor.Cancel();
  EXPECT_NO_THROW(executor.Drain(Lane::kMapping));
}

enum class LoopEnd { kDone, kStopped, kGivenUp };

// A loop is closed and all is adjusted after it, while mapping works through the keyframes that the
// correction moves and the caller reads them; in the end they are left to it, or stopped, or the map is given
// up. Returns whether the loop was closed.
bool CloseLoop(Executor& executor, LoopEnd end) {
  MapperOptions options;
  options.redundant_ratio = 1;  // the keyframes are near to each other, and are to stay
  TwoVisits visits(kDrift);
  SharedMap* const map = &visits.map.shared_map;
  const uint32_t epoch = map->Read()->epoch();
  LocalMapper mapper(visits.world.camera(), options, map);
  LoopCloser closer(visits.world.camera(), {}, 1, map);
  LoopResult loop;
  for (const KeyframeId id : visits.ids[1]) {
    executor.Post(Lane::kMapping, [&, id](const std::stop_token&) { mapper.Process(id, epoch); });
  }
  executor.Post(Lane::kLoop, [&](const std::stop_token& token) {
    const auto should_stop = [&token] {
      SchedulePoint();
      return token.stop_requested();
    };
    loop = closer.Process(visits.ids[1].back(), epoch, should_stop);
    AdjustAll(visits.world.camera(), options, should_stop, map);
  });
  for (int look = 0; look < 20; ++look) {
    const Rigid3 pose = map->Read()->PoseFromReference(visits.ids[1].front(), Rigid3());
    EXPECT_TRUE(pose.IsFinite());
  }
  if (end == LoopEnd::kStopped) executor.Cancel();
  if (end == LoopEnd::kGivenUp) map->Write()->ErasePart(PartId(0));
  for (const Lane lane : {Lane::kMapping, Lane::kLoop}) executor.Drain(lane);
  EXPECT_THAT(map->Read()->Validate(), IsEmpty());
  if (end == LoopEnd::kGivenUp) {
    EXPECT_EQ(map->Read()->keyframes().size(), 0u);
  } else if (loop.corrected) {
    EXPECT_LT(visits.WorstCenter(), 0.03);
  }
  return loop.corrected;
}

TEST(ShuffledLoopTest, ALoopIsClosedInAnyOrderOfTheStages) {
  int closed = 0, not_closed = 0;  // of those that were stopped or given up
  for (uint64_t seed = FirstSeed(); seed < SeedsOr(60); ++seed) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    const LoopEnd end = static_cast<LoopEnd>(seed % 3);
    ShuffledExecutor executor(seed);
    const bool is_closed = CloseLoop(executor, end);
    if (end == LoopEnd::kDone) {
      EXPECT_TRUE(is_closed);
    } else {
      ++(is_closed ? closed : not_closed);
    }
  }
  if (FirstSeed() > 0) return;
  EXPECT_GT(closed, 0) << "none was stopped after the correction";
  EXPECT_GT(not_closed, 0) << "none was stopped before it";
}

TEST(ThreadedLoopTest, ALoopIsClosedBesideMappingAndTracking) {
  for (int round = 0; round < 5; ++round) {
    const std::unique_ptr<Executor> executor = MakeThreadedExecutor();
    EXPECT_TRUE(CloseLoop(*executor, LoopEnd::kDone));
  }
}

// Whether `trial(seed)` shows the bug for one of the seeds; the first one.
template <class Trial>
std::optional<uint64_t> FirstSeedThatFinds(Trial&& trial) {
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    if (trial(seed)) return seed;
  }
  return std::nullopt;
}

// Planted: a count is read with one handle and written with the next, so that what the other thread adds in
// between is lost. Every access is locked: ThreadSanitizer has nothing to say.
TEST(PlantedTest, ALostUpdateIsFound) {
  const auto loses_one = [](uint64_t seed, bool planted) {
    Guarded<int> count(0);
    const auto add = [&count, planted] {
      if (planted) {
        const int old = *count.Read();
        *count.Write() = old + 1;
      } else {
        ++*count.Write();
      }
    };
    ShuffledExecutor executor(seed);
    executor.Post(Lane::kMapping, [&add](const std::stop_token&) { add(); });
    add();
    executor.Drain(Lane::kMapping);
    return *count.Read() != 2;
  };
  EXPECT_TRUE(FirstSeedThatFinds([&](uint64_t seed) { return loses_one(seed, true); }).has_value());
  EXPECT_FALSE(FirstSeedThatFinds([&](uint64_t seed) { return loses_one(seed, false); }).has_value());
}

// Planted in the whole SLAM: the mapping task asks for the map's epoch when it begins, not when the keyframe
// was made. When tracking gives the map up in between, the keyframe's id means nothing any more, or another
// keyframe.
TEST(PlantedTest, AnEpochThatIsReadTooLateIsFound) {
  const SmallRoom& room = SmallRoom::Get();
  const SystemOptions options = RunOptions();
  const auto goes_wrong = [&](uint64_t seed, bool planted) {
    SharedMap map(OctaveScales(options.orb));
    const Camera camera = SmallRoom::SmallCamera();
    Tracker tracker(camera, options.orb, options.tracker, options.dynamic, options.seed, &map);
    LocalMapper mapper(camera, options.mapper, &map);
    ShuffledExecutor executor(seed);
    try {
      for (int i = 0; i < 16; ++i) {
        tracker.Extract(FrameId(static_cast<uint32_t>(i)), room.Stamp(i),
                        i < 12 ? room.image(i) : SmallRoom::NoiseImage(i), {});
        const TrackingResult result = tracker.Track({}, executor.Waiting(Lane::kMapping));
        for (const KeyframeId keyframe : result.new_keyframes) {
          executor.Post(Lane::kMapping,
                        [&, planted, keyframe, epoch = result.map_epoch](const std::stop_token&) {
                          mapper.Process(keyframe, planted ? map.Read()->epoch() : epoch);
                        });
        }
      }
      executor.Drain(Lane::kMapping);
    } catch (const InternalError&) {
      return true;
    }
    return !map.Read()->Validate().empty();
  };
  EXPECT_TRUE(FirstSeedThatFinds([&](uint64_t seed) { return goes_wrong(seed, true); }).has_value());
  for (uint64_t seed = 0; seed < 10; ++seed) EXPECT_FALSE(goes_wrong(seed, false)) << seed;
}

}  // namespace
}  // namespace dynamic_slam
