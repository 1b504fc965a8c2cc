#include "dynamic_slam/base/crew.h"

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

Crew::Crew(TraceName name, int size) {
  DS_CHECK(size >= 1, "size={}", size);
  for (size_t member = 1; member < static_cast<size_t>(size); ++member) {
    workers_.push_back(std::make_unique<Worker>(name));
    workers_.back()->Post([this, member](const std::stop_token&) { WaitForLoops(member); });
  }
}

Crew::~Crew() {
  {
    MutexLock lock(mutex_);
    is_ending_ = true;
  }
  begun_.NotifyAll();
}

void Crew::Share(size_t count, Pass pass, void* context) {
  std::exception_ptr failure;
  {
    MutexLock lock(mutex_);
    pass_ = pass;
    context_ = context;
    next_ = 0;
    count_ = count;
    begun_.NotifyAll();
    TakePart(0);
    // Who wakes up only now finds nothing to do, and needs no waiting for.
    while (running_ > 0) done_.Wait(mutex_);
    failure = std::exchange(failure_, nullptr);
  }
  if (failure != nullptr) std::rethrow_exception(failure);
}

void Crew::WaitForLoops(size_t member) {
  MutexLock lock(mutex_);
  while (!is_ending_) {
    TakePart(member);
    begun_.Wait(mutex_);
  }
}

void Crew::TakePart(size_t member) {
  while (next_ < count_) {
    const size_t pass = next_++;
    ++running_;
    const Pass call = pass_;
    void* const context = context_;
    mutex_.Unlock();
    std::exception_ptr failure;
    try {
      call(context, pass, member);
    } catch (...) {
      failure = std::current_exception();
    }
    mutex_.Lock();
    --running_;
    if (failure == nullptr) continue;
    if (failure_ == nullptr) failure_ = failure;
    count_ = next_;
  }
  if (running_ == 0) done_.NotifyAll();
}

}  // namespace dynamic_slam
