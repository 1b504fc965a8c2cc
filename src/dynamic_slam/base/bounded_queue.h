#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <utility>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/mutex.h"

namespace dynamic_slam {

// Values on their way from one thread to another, oldest first, never more than `capacity`: when it is full,
// the oldest value makes room for the new one, since what waited longest is worth least to a camera's
// follower.
template <class T>
class BoundedQueue {
 public:
  explicit BoundedQueue(size_t capacity) : capacity_(capacity) { DS_CHECK(capacity > 0, "capacity=0"); }

  // The value that had to go, if any. After Close() that is the new one.
  std::optional<T> Push(T value) {
    MutexLock lock(mutex_);
    if (closed_) return value;
    std::optional<T> dropped;
    if (values_.size() == capacity_) {
      dropped = std::move(values_.front());
      values_.pop_front();
    }
    values_.push_back(std::move(value));
    changed_.NotifyOne();
    return dropped;
  }

  // Waits for a value; nothing when the queue is closed and empty.
  std::optional<T> Pop() {
    MutexLock lock(mutex_);
    while (values_.empty() && !closed_) changed_.Wait(mutex_);
    if (values_.empty()) return std::nullopt;
    std::optional<T> value = std::move(values_.front());
    values_.pop_front();
    return value;
  }

  // No more values will come; those inside can still be taken.
  void Close() {
    MutexLock lock(mutex_);
    closed_ = true;
    changed_.NotifyAll();
  }

 private:
  const size_t capacity_;
  Mutex mutex_;
  CondVar changed_;
  std::deque<T> values_ DS_GUARDED_BY(mutex_);
  bool closed_ DS_GUARDED_BY(mutex_) = false;
};

}  // namespace dynamic_slam
