#pragma once

#include <cstddef>
#include <exception>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynamic_slam/base/mutex.h"
#include "dynamic_slam/base/worker.h"

namespace dynamic_slam {

// Threads that share the passes of a loop with the one that calls. One loop at a time; asks for no memory.
class Crew {
 public:
  // size: of the threads at work, the caller's among them; 1 makes no other. Throws InternalError below 1.
  Crew(TraceName name, int size);
  ~Crew();
  Crew(const Crew&) = delete;
  Crew& operator=(const Crew&) = delete;

  size_t size() const { return workers_.size() + 1; }

  // Calls fn(size_t pass, size_t member) for each pass < count, begun in this order, and returns when all are
  // done. member: which thread it is, 0 the caller; below size(). The first exception of a pass ends the
  // loop: passes that have not begun are left out, and it is thrown again here.
  template <class Fn>
  void ForEach(size_t count, Fn&& fn) {
    if (workers_.empty()) {
      for (size_t pass = 0; pass < count; ++pass) fn(pass, size_t{0});
      return;
    }
    Share(
        count,
        [](void* context, size_t pass, size_t member) {
          (*static_cast<std::remove_reference_t<Fn>*>(context))(pass, member);
        },
        &fn);
  }

 private:
  using Pass = void (*)(void* context, size_t pass, size_t member);

  void Share(size_t count, Pass pass, void* context);
  void WaitForLoops(size_t member);
  // Passes of the loop for as long as there are some.
  void TakePart(size_t member) DS_REQUIRES(mutex_);

  Mutex mutex_;
  CondVar begun_, done_;
  Pass pass_ DS_GUARDED_BY(mutex_) = nullptr;
  void* context_ DS_GUARDED_BY(mutex_) = nullptr;
  size_t next_ DS_GUARDED_BY(mutex_) = 0, count_ DS_GUARDED_BY(mutex_) = 0;
  size_t running_ DS_GUARDED_BY(mutex_) = 0;
  bool is_ending_ DS_GUARDED_BY(mutex_) = false;
  std::exception_ptr failure_ DS_GUARDED_BY(mutex_);
  std::vector<std::unique_ptr<Worker>> workers_;  // last: they end before what they use
};

}  // namespace dynamic_slam
