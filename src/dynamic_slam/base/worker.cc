#include "dynamic_slam/base/worker.h"

#include <atomic>
#include <utility>

#include "dynamic_slam/base/thread_priority.h"

namespace dynamic_slam {
namespace {

std::atomic<int> abandoned_count = 0;

}  // namespace

Worker::Worker(TraceName name, std::chrono::milliseconds patience, Priority priority)
    : name_(name), patience_(patience), priority_(priority) {
  Start();
}

Worker::~Worker() {
  Cancel();
  {
    MutexLock lock(state_->mutex);
    state_->is_ending = true;
  }
  state_->changed.NotifyAll();
  thread_.join();
}

void Worker::Start() {
  state_ = std::make_shared<State>();
  thread_ = std::jthread([state = state_, name = name_, priority = priority_] {
    TraceThreadName(name);
    if (priority == Priority::kBackground) GiveWayToOthers();
    Run(*state);
  });
}

void Worker::Post(Task task) {
  {
    MutexLock lock(state_->mutex);
    if (state_->failure != nullptr) std::rethrow_exception(state_->failure);
    state_->tasks.push_back(std::move(task));
  }
  state_->changed.NotifyAll();
}

size_t Worker::Waiting() const {
  MutexLock lock(state_->mutex);
  return state_->tasks.size();
}

void Worker::Drain() {
  MutexLock lock(state_->mutex);
  while (state_->is_running || !state_->tasks.empty()) state_->changed.Wait(state_->mutex);
  if (state_->failure != nullptr) std::rethrow_exception(state_->failure);
}

void Worker::Cancel() {
  std::stop_source stop;
  {
    MutexLock lock(state_->mutex);
    state_->tasks.clear();
    stop = state_->stop;
  }
  stop.request_stop();  // not under the lock: it may call back
  {
    const bool is_patient = patience_ == kForever;
    const auto deadline =
        std::chrono::steady_clock::now() + (is_patient ? std::chrono::milliseconds(0) : patience_);
    MutexLock lock(state_->mutex);
    bool in_time = true;
    while (state_->is_running && in_time) {
      if (is_patient) {
        state_->changed.Wait(state_->mutex);
      } else {
        in_time = state_->changed.WaitUntil(state_->mutex, deadline);
      }
    }
    if (!state_->is_running) {
      state_->tasks.clear();
      state_->stop = std::stop_source();
      state_->failure = nullptr;
      return;
    }
    state_->is_abandoned = state_->is_ending = true;
    ++abandoned_count;
  }
  thread_.detach();
  Start();
}

void Worker::ThrowIfFailed() const {
  MutexLock lock(state_->mutex);
  if (state_->failure != nullptr) std::rethrow_exception(state_->failure);
}

int Worker::AbandonedCount() { return abandoned_count; }

void Worker::Run(State& state) {
  while (true) {
    Task task;
    std::stop_token token;
    {
      MutexLock lock(state.mutex);
      while (state.tasks.empty() && !state.is_ending) state.changed.Wait(state.mutex);
      if (state.tasks.empty()) return;
      task = std::move(state.tasks.front());
      state.tasks.pop_front();
      token = state.stop.get_token();
      state.is_running = true;
    }
    std::exception_ptr failure;
    try {
      task(token);
    } catch (...) {
      failure = std::current_exception();
    }
    task = nullptr;  // what it holds goes before anybody hears that it is done
    {
      MutexLock lock(state.mutex);
      state.is_running = false;
      if (state.is_abandoned) --abandoned_count;
      if (failure != nullptr) {
        state.failure = failure;
        state.tasks.clear();
      }
    }
    state.changed.NotifyAll();
  }
}

}  // namespace dynamic_slam
