#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

// Clang's thread safety analysis: which lock guards a member, and which a function needs, takes or must not
// hold. Clang refuses code that breaks it (tests/lint_thread_safety.py); for other compilers these are empty.
//   https://clang.llvm.org/docs/ThreadSafetyAnalysis.html
#if defined(__clang__)
#define DS_THREAD_ANNOTATION(x) __attribute__((x))
#else
#define DS_THREAD_ANNOTATION(x)
#endif

// Of a member: read and written only with the lock held; PT: what the pointer points to.
#define DS_GUARDED_BY(mutex) DS_THREAD_ANNOTATION(guarded_by(mutex))
#define DS_PT_GUARDED_BY(mutex) DS_THREAD_ANNOTATION(pt_guarded_by(mutex))

// Of a function: the caller holds the lock (for reading at least: SHARED), or must not hold it.
#define DS_REQUIRES(...) DS_THREAD_ANNOTATION(requires_capability(__VA_ARGS__))
#define DS_REQUIRES_SHARED(...) DS_THREAD_ANNOTATION(requires_shared_capability(__VA_ARGS__))
#define DS_EXCLUDES(...) DS_THREAD_ANNOTATION(locks_excluded(__VA_ARGS__))

// Of a function: it returns with the lock held, or released. GENERIC releases whichever was held.
#define DS_ACQUIRE(...) DS_THREAD_ANNOTATION(acquire_capability(__VA_ARGS__))
#define DS_ACQUIRE_SHARED(...) DS_THREAD_ANNOTATION(acquire_shared_capability(__VA_ARGS__))
#define DS_RELEASE(...) DS_THREAD_ANNOTATION(release_capability(__VA_ARGS__))
#define DS_RELEASE_SHARED(...) DS_THREAD_ANNOTATION(release_shared_capability(__VA_ARGS__))
#define DS_RELEASE_GENERIC(...) DS_THREAD_ANNOTATION(release_generic_capability(__VA_ARGS__))
#define DS_TRY_ACQUIRE(...) DS_THREAD_ANNOTATION(try_acquire_capability(__VA_ARGS__))

// Of a function: it returns this lock; it checks that the lock is held; its body is not analysed (say why).
#define DS_RETURN_CAPABILITY(mutex) DS_THREAD_ANNOTATION(lock_returned(mutex))
#define DS_ASSERT_CAPABILITY(mutex) DS_THREAD_ANNOTATION(assert_capability(mutex))
#define DS_NO_THREAD_SAFETY_ANALYSIS DS_THREAD_ANNOTATION(no_thread_safety_analysis)

// Of a class: it is a lock ("mutex" in messages), or holds one from its constructor to its destructor.
#define DS_CAPABILITY(name) DS_THREAD_ANNOTATION(capability(name))
#define DS_SCOPED_CAPABILITY DS_THREAD_ANNOTATION(scoped_lockable)

namespace dynamic_slam {

// std::mutex with annotations, which libstdc++'s has not.
class DS_CAPABILITY("mutex") Mutex {
 public:
  Mutex() = default;
  Mutex(const Mutex&) = delete;
  Mutex& operator=(const Mutex&) = delete;

  void Lock() DS_ACQUIRE() { mutex_.lock(); }
  void Unlock() DS_RELEASE() { mutex_.unlock(); }
  bool TryLock() DS_TRY_ACQUIRE(true) { return mutex_.try_lock(); }

 private:
  friend class CondVar;
  std::mutex mutex_;
};

// Holds a mutex as long as it lives.
class DS_SCOPED_CAPABILITY MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) DS_ACQUIRE(mutex) : mutex_(mutex) { mutex_.Lock(); }
  ~MutexLock() DS_RELEASE() { mutex_.Unlock(); }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

 private:
  Mutex& mutex_;
};

// Waits for what another thread does under a mutex, which is held before and after a wait but not during it.
// A wait may also end for no reason, so it belongs in a loop. There are no waits with a predicate, since the
// analysis does not see that a lambda runs with the lock held:
//
//   MutexLock lock(mutex_);
//   while (queue_.empty()) not_empty_.Wait(mutex_);
class CondVar {
 public:
  void Wait(Mutex& mutex) DS_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    condition_.wait(lock);
    lock.release();  // the caller's MutexLock unlocks
  }

  // False when the time was up.
  bool WaitUntil(Mutex& mutex, std::chrono::steady_clock::time_point deadline) DS_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    const std::cv_status status = condition_.wait_until(lock, deadline);
    lock.release();
    return status == std::cv_status::no_timeout;
  }

  void NotifyOne() { condition_.notify_one(); }
  void NotifyAll() { condition_.notify_all(); }

 private:
  std::condition_variable condition_;
};

}  // namespace dynamic_slam
