#pragma once

#include <memory>

#include "dynamic_slam/base/worker.h"

namespace dynamic_slam {

// A queue of tasks that run one after the other. Tracking has none: it runs on the caller's thread.
enum class Lane { kMapping, kDetection, kLoop };
inline constexpr Lane kLanes[] = {Lane::kMapping, Lane::kDetection, Lane::kLoop};

TraceName Name(Lane lane);

// Where and when the stages beside tracking run. To be called from one thread.
//
// What a task throws reaches the caller by the same or the next call of Post, and by each one of Drain and
// ThrowIfFailed until Cancel().
class Executor {
 public:
  using Task = Worker::Task;

  virtual ~Executor() = default;
  virtual void Post(Lane lane, Task task) = 0;

  // Tasks that have not begun. Tasks may ask too.
  virtual int Waiting(Lane lane) const = 0;

  // Returns when all tasks of the lane are done.
  virtual void Drain(Lane lane) = 0;

  // Drops the tasks that wait, asks those that run to stop, and returns when they have. A detector that does
  // not is abandoned after a second: its tasks must own what they touch.
  virtual void Cancel() = 0;

  virtual void ThrowIfFailed() const = 0;
};

// Runs each task at once, on the caller's thread: one fixed order.
std::unique_ptr<Executor> MakeInlineExecutor();

// A thread for each lane.
std::unique_ptr<Executor> MakeThreadedExecutor();

}  // namespace dynamic_slam
