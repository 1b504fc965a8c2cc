#pragma once

namespace dynamic_slam {

// Decides at schedule points which thread goes on.
class Scheduler {
 public:
  virtual ~Scheduler() = default;
  virtual void OnSchedulePoint() = 0;
};

// Of the calling thread; not owned. Only tests set it (tests/shuffled_executor.h).
inline thread_local Scheduler* this_thread_scheduler = nullptr;

// A place where another thread may come first: before a shared value is locked, and after it is released.
inline void SchedulePoint() {
  if (this_thread_scheduler != nullptr) this_thread_scheduler->OnSchedulePoint();
}

}  // namespace dynamic_slam
