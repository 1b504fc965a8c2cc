#pragma once

#include <array>
#include <deque>
#include <memory>
#include <vector>

#include "dynamic_slam/base/mutex.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/base/schedule_point.h"
#include "dynamic_slam/system/executor.h"

namespace dynamic_slam {

// Draws how the stages interleave. The caller and each lane are players with a thread each, but only the one
// that has the baton runs; at schedule points, and where a task is posted, begins, is counted or ends, a
// seeded draw among those that have something to do says who gets it. So the same seed gives the same
// interleaving, and a bug of order comes again.
//
// It finds what goes wrong between two looks at a shared value. It does not find accesses without a lock, as
// the baton orders them too: that is ThreadSanitizer's part.
//
// One at a time in each thread, made, used and destroyed by the caller.
class ShuffledExecutor : public Executor, public Scheduler {
 public:
  explicit ShuffledExecutor(uint64_t seed);
  ~ShuffledExecutor() override;

  void Post(Lane lane, Task task) override;
  int Waiting(Lane lane) const override;
  void Drain(Lane lane) override;  // all lanes
  void Cancel() override;
  void ThrowIfFailed() const override;

  void OnSchedulePoint() override;

  // Who got the baton at each draw: 0 is the caller, 1 the first lane.
  std::vector<int> Decisions() const;

 private:
  static constexpr int kCaller = 0;
  static constexpr int kPlayers = 1 + static_cast<int>(std::size(kLanes));

  struct LaneState {
    std::deque<Task> tasks;
    bool is_busy = false;
    std::stop_source stop;
    std::exception_ptr failure;
  };

  static int Player(Lane lane) { return 1 + static_cast<int>(lane); }
  LaneState& State(int player) DS_REQUIRES(mutex_) { return lanes_[static_cast<size_t>(player - 1)]; }

  bool CanGoOn(int player) const DS_REQUIRES(mutex_);
  bool AllIdle() const DS_REQUIRES(mutex_);
  // Hands the baton to whom the draw says.
  void Draw() DS_REQUIRES(mutex_);
  // False: the executor ends.
  bool WaitForBaton(int player) DS_REQUIRES(mutex_);
  void WaitUntilIdle() DS_REQUIRES(mutex_);
  void RunLane(int player);

  mutable Mutex mutex_;
  mutable CondVar changed_;
  Random random_ DS_GUARDED_BY(mutex_);
  int has_baton_ DS_GUARDED_BY(mutex_) = kCaller;
  bool caller_waits_ DS_GUARDED_BY(mutex_) = false;  // until all lanes are idle
  // Draws one by one would keep all about equally fast. For a while one is much faster than the others.
  int favourite_ DS_GUARDED_BY(mutex_) = kCaller;
  int favoured_draws_ DS_GUARDED_BY(mutex_) = 0;
  bool is_ending_ DS_GUARDED_BY(mutex_) = false;
  std::array<LaneState, std::size(kLanes)> lanes_ DS_GUARDED_BY(mutex_);
  std::vector<int> decisions_ DS_GUARDED_BY(mutex_);
  std::vector<std::unique_ptr<Worker>> threads_;  // last: they use all the others
};

}  // namespace dynamic_slam
