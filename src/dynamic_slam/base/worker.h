#pragma once

#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <stop_token>
#include <thread>

#include "dynamic_slam/base/mutex.h"
#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {

// A thread that runs tasks one after the other, in the order in which they were posted. All threads of the
// program are workers; tests/lint_layers.py checks it.
//
// What a task throws is kept, the tasks after it are dropped, and each call of Post, Drain and ThrowIfFailed
// throws it again until Cancel().
class Worker {
 public:
  // The token says when the result is not wanted any more.
  using Task = std::function<void(const std::stop_token&)>;

  explicit Worker(TraceName name);
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void Post(Task task);

  // Tasks that have not begun.
  size_t Waiting() const;

  // Returns when nothing waits or runs.
  void Drain();

  // Drops what waits, asks what runs to stop, and returns when it has. The worker can go on after that.
  void Cancel();

  void ThrowIfFailed() const;

 private:
  void Run();

  const TraceName name_;
  mutable Mutex mutex_;
  CondVar changed_;
  std::deque<Task> tasks_ DS_GUARDED_BY(mutex_);
  bool is_running_ DS_GUARDED_BY(mutex_) = false;
  bool is_ending_ DS_GUARDED_BY(mutex_) = false;
  std::stop_source stop_ DS_GUARDED_BY(mutex_);
  std::exception_ptr failure_ DS_GUARDED_BY(mutex_);
  std::jthread thread_;
};

}  // namespace dynamic_slam
