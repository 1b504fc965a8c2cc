#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
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

  static constexpr std::chrono::milliseconds kForever = std::chrono::milliseconds::max();

  // kBackground: the thread gets a processor when the others leave one, or about a tenth of one (Linux; the
  // same as kNormal elsewhere).
  enum class Priority { kNormal, kBackground };

  // patience: how long Cancel() waits for a task that does not heed the token. After that its thread is left
  // alone with it, and a new one takes its place. Tasks of a worker without endless patience must own all
  // that they touch.
  explicit Worker(TraceName name, std::chrono::milliseconds patience = kForever,
                  Priority priority = Priority::kNormal);
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void Post(Task task);

  // Tasks that have not begun.
  size_t Waiting() const;

  // Returns when nothing waits or runs.
  void Drain();

  // Drops what waits, asks what runs to stop, and returns when it has or was abandoned. The worker can go on
  // after that.
  void Cancel();

  void ThrowIfFailed() const;

  // Threads left alone that have not ended since. While there are some, the program should end without
  // destroying what they may use (std::_Exit).
  static int AbandonedCount();

 private:
  // What the thread and its owner share; an abandoned thread keeps its own.
  struct State {
    mutable Mutex mutex;
    CondVar changed;
    std::deque<Task> tasks DS_GUARDED_BY(mutex);
    bool is_running DS_GUARDED_BY(mutex) = false;
    bool is_ending DS_GUARDED_BY(mutex) = false;
    bool is_abandoned DS_GUARDED_BY(mutex) = false;
    std::stop_source stop DS_GUARDED_BY(mutex);
    std::exception_ptr failure DS_GUARDED_BY(mutex);
  };

  static void Run(State& state);
  void Start();

  const TraceName name_;
  const std::chrono::milliseconds patience_;
  const Priority priority_;
  std::shared_ptr<State> state_;
  std::jthread thread_;
};

}  // namespace dynamic_slam
