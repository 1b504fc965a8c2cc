#include "dynamic_slam/base/worker.h"

#include <atomic>
#include <stdexcept>
#include <vector>

#ifdef __linux__
#include <sys/resource.h>
#include <unistd.h>
#endif

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/bounded_queue.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/guarded.h"

namespace dynamic_slam {
namespace {

using testing::ElementsAre;

// Runs until it is asked to stop.
void RunUntilStopped(const std::stop_token& token) {
  while (!token.stop_requested()) std::this_thread::yield();
}

TEST(WorkerTest, TasksRunInOrder) {
  Worker worker("test");
  std::vector<int> done;
  for (int i = 0; i < 5; ++i) worker.Post([&done, i](const std::stop_token&) { done.push_back(i); });
  worker.Drain();
  EXPECT_THAT(done, ElementsAre(0, 1, 2, 3, 4));
  EXPECT_EQ(worker.Waiting(), 0u);
}

#ifdef __linux__
TEST(WorkerTest, TheBackgroundGivesWayToOthers) {
  const auto niceness_of = [](Worker::Priority priority) {
    Worker worker("test", Worker::kForever, priority);
    std::atomic<int> niceness = -100;
    worker.Post(
        [&](const std::stop_token&) { niceness = getpriority(PRIO_PROCESS, static_cast<id_t>(gettid())); });
    worker.Drain();
    return niceness.load();
  };
  const int own = getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()));
  EXPECT_EQ(niceness_of(Worker::Priority::kNormal), own);
  EXPECT_GE(niceness_of(Worker::Priority::kBackground), own);
  EXPECT_GE(niceness_of(Worker::Priority::kBackground), 10);
}
#endif

TEST(WorkerTest, CancelDropsWhatWaitsAndStopsWhatRuns) {
  Worker worker("test");
  std::atomic<bool> began = false, second = false;
  worker.Post([&](const std::stop_token& token) {
    began = true;
    RunUntilStopped(token);
  });
  worker.Post([&](const std::stop_token&) { second = true; });
  while (!began) std::this_thread::yield();
  EXPECT_EQ(worker.Waiting(), 1u);
  worker.Cancel();
  worker.Cancel();
  EXPECT_EQ(worker.Waiting(), 0u);
  EXPECT_FALSE(second);
  bool third = false, was_stopped = true;
  worker.Post([&](const std::stop_token& token) {
    third = true;
    was_stopped = token.stop_requested();
  });
  worker.Drain();
  EXPECT_TRUE(third) << "it can go on";
  EXPECT_FALSE(was_stopped);
}

TEST(WorkerTest, AnExceptionReachesWhoeverAsks) {
  Worker worker("test");
  bool after = false;
  worker.Post([](const std::stop_token& token) {
    RunUntilStopped(token);
    throw std::runtime_error("disk full");
  });
  worker.Post([&after](const std::stop_token&) { after = true; });
  worker.Cancel();  // the failure of a task that nobody wants is nobody's
  EXPECT_NO_THROW(worker.ThrowIfFailed());
  EXPECT_FALSE(after);

  worker.Post([](const std::stop_token&) { throw std::runtime_error("disk full"); });
  EXPECT_THROW(worker.Drain(), std::runtime_error);
  EXPECT_THROW(worker.Drain(), std::runtime_error) << "until it is cancelled";
  EXPECT_THROW(worker.Post([](const std::stop_token&) {}), std::runtime_error);
  EXPECT_THROW(worker.ThrowIfFailed(), std::runtime_error);
  worker.Cancel();
  EXPECT_NO_THROW(worker.Drain());
}

TEST(WorkerTest, TheDestructorStopsATaskThatRuns) {
  std::atomic<bool> began = false, ended = false;
  {
    Worker worker("test");
    worker.Post([&](const std::stop_token& token) {
      began = true;
      RunUntilStopped(token);
      ended = true;
    });
    while (!began) std::this_thread::yield();
  }
  EXPECT_TRUE(ended);
}

TEST(WorkerTest, AThreadThatDoesNotHeedIsLeftAlone) {
  const auto may_end = std::make_shared<std::atomic<bool>>(false);
  const auto began = std::make_shared<std::atomic<bool>>(false);
  {
    Worker worker("test", std::chrono::milliseconds(20));
    worker.Post([may_end, began](const std::stop_token&) {
      *began = true;
      while (!*may_end) std::this_thread::yield();
    });
    while (!*began) std::this_thread::yield();
    worker.Cancel();
    EXPECT_EQ(Worker::AbandonedCount(), 1);
    bool second = false;
    worker.Post([&second](const std::stop_token&) { second = true; });
    worker.Drain();
    EXPECT_TRUE(second) << "a new thread has taken its place";
  }
  *may_end = true;
  while (Worker::AbandonedCount() > 0) std::this_thread::yield();
}

TEST(BoundedQueueTest, TheOldestMakesRoom) {
  BoundedQueue<int> queue(2);
  EXPECT_EQ(queue.Push(1), std::nullopt);
  EXPECT_EQ(queue.Push(2), std::nullopt);
  EXPECT_EQ(queue.Push(3), 1);
  queue.Close();
  EXPECT_EQ(queue.Push(4), 4) << "closed";
  EXPECT_EQ(queue.Pop(), 2);
  EXPECT_EQ(queue.Pop(), 3);
  EXPECT_EQ(queue.Pop(), std::nullopt);
}

TEST(BoundedQueueTest, PopWaitsForAValueAndForTheEnd) {
  BoundedQueue<int> queue(1);
  Worker worker("test");
  worker.Post([&queue](const std::stop_token&) {
    queue.Push(7);
    queue.Close();
  });
  EXPECT_EQ(queue.Pop(), 7);
  EXPECT_EQ(queue.Pop(), std::nullopt);
}

TEST(GuardedTest, ASecondHandleInOneThreadIsABugThatIsNamed) {
  Guarded<int> a(1);
  Guarded<double> b(2);
  {
    const auto first = a.Read();
    EXPECT_THROW(a.Write(), InternalError);
    EXPECT_THROW(a.Read(), InternalError);
    EXPECT_THROW(b.Read(), InternalError) << "another value";
  }
  EXPECT_EQ(*a.Write(), 1) << "one after the other";
  EXPECT_EQ(*b.Read(), 2);
}

TEST(GuardedTest, WritesOfTwoThreadsAddUp) {
  Guarded<int> sum(0);
  const auto add = [&sum](const std::stop_token&) {
    for (int i = 0; i < 1000; ++i) ++*sum.Write();
  };
  Worker a("a"), b("b");
  a.Post(add);
  b.Post(add);
  a.Drain();
  b.Drain();
  EXPECT_EQ(*sum.Read(), 2000);
}

}  // namespace
}  // namespace dynamic_slam
