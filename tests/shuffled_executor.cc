#include "shuffled_executor.h"

#include <algorithm>
#include <utility>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/guarded.h"

namespace dynamic_slam {
namespace {

thread_local int this_player = -1;

}  // namespace

ShuffledExecutor::ShuffledExecutor(uint64_t seed) : random_(seed) {
  DS_CHECK(this_thread_scheduler == nullptr, "this thread has a scheduler already");
  this_thread_scheduler = this;
  this_player = kCaller;
  for (const Lane lane : kLanes) {
    threads_.push_back(std::make_unique<Worker>(Name(lane)));
    threads_.back()->Post([this, lane](const std::stop_token&) { RunLane(Player(lane)); });
  }
}

ShuffledExecutor::~ShuffledExecutor() {
  Cancel();
  {
    MutexLock lock(mutex_);
    is_ending_ = true;
  }
  changed_.NotifyAll();
  threads_.clear();
  this_thread_scheduler = nullptr;
}

void ShuffledExecutor::Post(Lane lane, Task task) {
  ThrowIfFailed();
  {
    MutexLock lock(mutex_);
    State(Player(lane)).tasks.push_back(std::move(task));
  }
  OnSchedulePoint();
}

int ShuffledExecutor::Waiting(Lane lane) const {
  SchedulePoint();
  MutexLock lock(mutex_);
  return static_cast<int>(lanes_[static_cast<size_t>(lane)].tasks.size());
}

void ShuffledExecutor::Drain(Lane) {
  {
    MutexLock lock(mutex_);
    WaitUntilIdle();
  }
  ThrowIfFailed();
}

void ShuffledExecutor::Cancel() {
  std::vector<std::stop_source> stops;
  {
    MutexLock lock(mutex_);
    for (LaneState& lane : lanes_) {
      lane.tasks.clear();
      stops.push_back(lane.stop);
    }
  }
  for (std::stop_source& stop : stops) stop.request_stop();
  MutexLock lock(mutex_);
  WaitUntilIdle();
  for (LaneState& lane : lanes_) {
    lane.stop = std::stop_source();
    lane.failure = nullptr;
  }
}

void ShuffledExecutor::ThrowIfFailed() const {
  MutexLock lock(mutex_);
  for (const LaneState& lane : lanes_) {
    if (lane.failure != nullptr) std::rethrow_exception(lane.failure);
  }
}

void ShuffledExecutor::OnSchedulePoint() {
  // Whoever comes next may want that lock, and would wait for it with the baton in hand.
  DS_CHECK(!internal::this_thread_has_handle, "a schedule point with a handle held");
  MutexLock lock(mutex_);
  Draw();
  WaitForBaton(this_player);
}

std::vector<int> ShuffledExecutor::Decisions() const {
  MutexLock lock(mutex_);
  return decisions_;
}

bool ShuffledExecutor::AllIdle() const {
  return std::all_of(lanes_.begin(), lanes_.end(),
                     [](const LaneState& lane) { return !lane.is_busy && lane.tasks.empty(); });
}

bool ShuffledExecutor::CanGoOn(int player) const {
  if (player == kCaller) return !caller_waits_ || AllIdle();
  const LaneState& lane = lanes_[static_cast<size_t>(player - 1)];
  return lane.is_busy || !lane.tasks.empty();
}

void ShuffledExecutor::Draw() {
  std::array<int, kPlayers> able{};
  uint32_t count = 0;
  for (int player = 0; player < kPlayers; ++player) {
    if (CanGoOn(player)) able[count++] = player;
  }
  DS_CHECK(count > 0, "nobody can go on");
  if (favoured_draws_-- == 0) {
    favourite_ = static_cast<int>(random_.Index(kPlayers));
    favoured_draws_ = 1 << random_.Index(8);
  }
  const bool takes_favourite = random_.Index(8) != 0 && CanGoOn(favourite_);
  has_baton_ = takes_favourite ? favourite_ : able[random_.Index(count)];
  decisions_.push_back(has_baton_);
  changed_.NotifyAll();
}

bool ShuffledExecutor::WaitForBaton(int player) {
  while (has_baton_ != player && !is_ending_) changed_.Wait(mutex_);
  return !is_ending_;
}

void ShuffledExecutor::WaitUntilIdle() {
  caller_waits_ = true;
  Draw();
  WaitForBaton(kCaller);
  caller_waits_ = false;
}

void ShuffledExecutor::RunLane(int player) {
  this_thread_scheduler = this;
  this_player = player;
  while (true) {
    Task task;
    std::stop_token token;
    {
      MutexLock lock(mutex_);
      if (!WaitForBaton(player)) return;
      LaneState& lane = State(player);
      task = std::move(lane.tasks.front());
      lane.tasks.pop_front();
      lane.is_busy = true;
      token = lane.stop.get_token();
    }
    std::exception_ptr failure;
    try {
      OnSchedulePoint();  // begun, and nothing done yet
      task(token);
    } catch (...) {
      failure = std::current_exception();
    }
    task = nullptr;
    MutexLock lock(mutex_);
    LaneState& lane = State(player);
    lane.is_busy = false;
    if (failure != nullptr) {
      lane.failure = failure;
      lane.tasks.clear();
    }
    Draw();
  }
}

}  // namespace dynamic_slam
