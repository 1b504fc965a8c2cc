#include "dynamic_slam/base/worker.h"

#include <utility>

namespace dynamic_slam {

Worker::Worker(TraceName name) : name_(name), thread_([this] { Run(); }) {}

Worker::~Worker() {
  Cancel();
  {
    MutexLock lock(mutex_);
    is_ending_ = true;
  }
  changed_.NotifyAll();
  thread_.join();
}

void Worker::Post(Task task) {
  {
    MutexLock lock(mutex_);
    if (failure_ != nullptr) std::rethrow_exception(failure_);
    tasks_.push_back(std::move(task));
  }
  changed_.NotifyAll();
}

size_t Worker::Waiting() const {
  MutexLock lock(mutex_);
  return tasks_.size();
}

void Worker::Drain() {
  MutexLock lock(mutex_);
  while (is_running_ || !tasks_.empty()) changed_.Wait(mutex_);
  if (failure_ != nullptr) std::rethrow_exception(failure_);
}

void Worker::Cancel() {
  std::stop_source stop;
  {
    MutexLock lock(mutex_);
    tasks_.clear();
    stop = stop_;
  }
  stop.request_stop();  // not under the lock: it may call back
  MutexLock lock(mutex_);
  while (is_running_) changed_.Wait(mutex_);
  tasks_.clear();
  stop_ = std::stop_source();
  failure_ = nullptr;
}

void Worker::ThrowIfFailed() const {
  MutexLock lock(mutex_);
  if (failure_ != nullptr) std::rethrow_exception(failure_);
}

void Worker::Run() {
  TraceThreadName(name_);
  while (true) {
    Task task;
    std::stop_token token;
    {
      MutexLock lock(mutex_);
      while (tasks_.empty() && !is_ending_) changed_.Wait(mutex_);
      if (tasks_.empty()) return;
      task = std::move(tasks_.front());
      tasks_.pop_front();
      token = stop_.get_token();
      is_running_ = true;
    }
    std::exception_ptr failure;
    try {
      task(token);
    } catch (...) {
      failure = std::current_exception();
    }
    task = nullptr;  // what it holds goes before anybody hears that it is done
    {
      MutexLock lock(mutex_);
      is_running_ = false;
      if (failure != nullptr) {
        failure_ = failure;
        tasks_.clear();
      }
    }
    changed_.NotifyAll();
  }
}

}  // namespace dynamic_slam
