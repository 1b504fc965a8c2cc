#include "dynamic_slam/system/executor.h"

#include <array>
#include <chrono>
#include <exception>

namespace dynamic_slam {
namespace {

// A network cannot be interrupted.
constexpr std::chrono::milliseconds kDetectorPatience(1000);

class InlineExecutor : public Executor {
 public:
  void Post(Lane, Task task) override {
    ThrowIfFailed();
    try {
      task(std::stop_token());
    } catch (...) {
      failure_ = std::current_exception();
      throw;
    }
  }
  int Waiting(Lane) const override { return 0; }
  void Drain(Lane) override { ThrowIfFailed(); }
  void Cancel() override { failure_ = nullptr; }
  void ThrowIfFailed() const override {
    if (failure_ != nullptr) std::rethrow_exception(failure_);
  }

 private:
  std::exception_ptr failure_;
};

class ThreadedExecutor : public Executor {
 public:
  ThreadedExecutor() {
    for (const Lane lane : kLanes) {
      const bool may_hang = lane == Lane::kDetection;
      workers_[Index(lane)] =
          std::make_unique<Worker>(Name(lane), may_hang ? kDetectorPatience : Worker::kForever);
    }
  }
  void Post(Lane lane, Task task) override { workers_[Index(lane)]->Post(std::move(task)); }
  int Waiting(Lane lane) const override { return static_cast<int>(workers_[Index(lane)]->Waiting()); }
  void Drain(Lane lane) override { workers_[Index(lane)]->Drain(); }
  void Cancel() override {
    for (const auto& worker : workers_) worker->Cancel();
  }
  void ThrowIfFailed() const override {
    for (const auto& worker : workers_) worker->ThrowIfFailed();
  }

 private:
  static size_t Index(Lane lane) { return static_cast<size_t>(lane); }

  std::array<std::unique_ptr<Worker>, std::size(kLanes)> workers_;
};

}  // namespace

TraceName Name(Lane lane) {
  switch (lane) {
    case Lane::kMapping:
      return "mapping";
    case Lane::kDetection:
      return "detection";
    case Lane::kLoop:
      return "loop";
  }
  return "";
}

std::unique_ptr<Executor> MakeInlineExecutor() { return std::make_unique<InlineExecutor>(); }

std::unique_ptr<Executor> MakeThreadedExecutor() { return std::make_unique<ThreadedExecutor>(); }

}  // namespace dynamic_slam
