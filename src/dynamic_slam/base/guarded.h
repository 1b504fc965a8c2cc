#pragma once

#include <cstdint>
#include <shared_mutex>
#include <utility>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/mutex.h"
#include "dynamic_slam/base/schedule_point.h"

namespace dynamic_slam {

// std::shared_mutex with annotations: many readers or one writer.
class DS_CAPABILITY("shared mutex") SharedMutex {
 public:
  void Lock() DS_ACQUIRE() { mutex_.lock(); }
  void Unlock() DS_RELEASE() { mutex_.unlock(); }
  void LockShared() DS_ACQUIRE_SHARED() { mutex_.lock_shared(); }
  void UnlockShared() DS_RELEASE_SHARED() { mutex_.unlock_shared(); }

 private:
  std::shared_mutex mutex_;
};

namespace internal {

inline thread_local bool this_thread_has_handle = false;

inline void EnterGuarded() {
  DS_CHECK(!this_thread_has_handle, "a second handle in one thread");
  SchedulePoint();
  this_thread_has_handle = true;
}

inline void LeaveGuarded() {
  this_thread_has_handle = false;
  SchedulePoint();
}

}  // namespace internal

// A value that several threads share and that nobody reaches without its lock:
//
//   auto map = shared_map.Read();  // or Write()
//   map->keyframes()...            // locked until `map` goes out of scope
//
// Keep handles for a moment only, and no pointer into the value longer than its handle. A thread has one
// handle at a time: with a second one of the same value it would wait for itself, with one of another value
// two threads could wait for each other. That is checked (InternalError).
template <class T>
class Guarded {
 public:
  // The analysis of clang 14 does not follow a lock that a function returns; these two classes keep the rule
  // by construction instead: a handle holds the lock while it lives, and there is no other way to the value.
  class ReadHandle {
   public:
    ~ReadHandle() DS_NO_THREAD_SAFETY_ANALYSIS {
      guarded_.mutex_.UnlockShared();
      internal::LeaveGuarded();
    }
    ReadHandle(const ReadHandle&) = delete;
    ReadHandle& operator=(const ReadHandle&) = delete;
    const T& operator*() const DS_NO_THREAD_SAFETY_ANALYSIS { return guarded_.value_; }
    const T* operator->() const { return &**this; }

    // How often the value was open for writing: as long as that stays the same, so does the value.
    uint64_t Writes() const DS_NO_THREAD_SAFETY_ANALYSIS { return guarded_.writes_; }

   private:
    friend class Guarded;
    explicit ReadHandle(const Guarded& guarded) DS_NO_THREAD_SAFETY_ANALYSIS : guarded_(guarded) {
      internal::EnterGuarded();
      guarded_.mutex_.LockShared();
    }
    const Guarded& guarded_;
  };

  class WriteHandle {
   public:
    ~WriteHandle() DS_NO_THREAD_SAFETY_ANALYSIS {
      guarded_.mutex_.Unlock();
      internal::LeaveGuarded();
    }
    WriteHandle(const WriteHandle&) = delete;
    WriteHandle& operator=(const WriteHandle&) = delete;
    T& operator*() const DS_NO_THREAD_SAFETY_ANALYSIS { return guarded_.value_; }
    T* operator->() const { return &**this; }
    T* get() const { return &**this; }

   private:
    friend class Guarded;
    explicit WriteHandle(Guarded& guarded) DS_NO_THREAD_SAFETY_ANALYSIS : guarded_(guarded) {
      internal::EnterGuarded();
      guarded_.mutex_.Lock();
      ++guarded_.writes_;
    }
    Guarded& guarded_;
  };

  template <class... Args>
  explicit Guarded(Args&&... args) : value_(std::forward<Args>(args)...) {}
  Guarded(const Guarded&) = delete;
  Guarded& operator=(const Guarded&) = delete;

  [[nodiscard]] ReadHandle Read() const { return ReadHandle(*this); }
  [[nodiscard]] WriteHandle Write() { return WriteHandle(*this); }

 private:
  mutable SharedMutex mutex_;
  uint64_t writes_ DS_GUARDED_BY(mutex_) = 0;
  T value_ DS_GUARDED_BY(mutex_);
};

}  // namespace dynamic_slam
