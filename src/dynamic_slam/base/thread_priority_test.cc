#include "dynamic_slam/base/thread_priority.h"

#include <gtest/gtest.h>

#ifdef __linux__
#include <algorithm>
#include <functional>

#include <sys/resource.h>
#include <unistd.h>

#include "dynamic_slam/base/worker.h"

namespace dynamic_slam {
namespace {

int Niceness() { return getpriority(PRIO_PROCESS, static_cast<id_t>(gettid())); }

bool Renice(int niceness) { return setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), niceness) == 0; }

// A thread of its own, whose niceness may go astray.
void InThread(const std::function<void()>& run) {
  Worker worker("test");
  worker.Post([&](const std::stop_token&) { run(); });
  worker.Drain();
}

TEST(ThreadPriorityTest, AnUrgentSectionComesFirstWhereTheSystemLetsItAndEndsWithItsScope) {
  InThread([] {
    const int own = Niceness();
    const int nicer = std::max(-20, own - 10);
    const bool may = Renice(nicer) && Renice(own);
    {
      const UrgentSection urgent;
      EXPECT_EQ(Niceness(), may ? nicer : own);
    }
    EXPECT_EQ(Niceness(), own);
    {
      const UrgentSection not_urgent(false);
      EXPECT_EQ(Niceness(), own);
    }
  });
}

TEST(ThreadPriorityTest, GivingWayIsOfOneThreadOnlyAndNeverPutsItForward) {
  const int own = Niceness();
  InThread([&] {
    GiveWayToOthers();
    EXPECT_EQ(Niceness(), std::max(10, own));
    Renice(19);
    GiveWayToOthers();
    EXPECT_EQ(Niceness(), 19);
  });
  EXPECT_EQ(Niceness(), own);
}

}  // namespace
}  // namespace dynamic_slam
#endif
