#include "dynamic_slam/base/crew.h"

#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

class CrewTest : public testing::TestWithParam<int> {
 protected:
  Crew crew_{"test", GetParam()};
};

INSTANTIATE_TEST_SUITE_P(Sizes, CrewTest, testing::Values(1, 2, 5));

TEST_P(CrewTest, EachPassIsMadeOnceBeforeTheLoopEnds) {
  for (const size_t count : {0u, 1u, 7u, 100u}) {
    std::vector<int> passes(count);
    crew_.ForEach(count, [&](size_t pass, size_t member) {
      EXPECT_LT(member, crew_.size());
      ++passes[pass];
    });
    EXPECT_THAT(passes, testing::Each(1));
  }
}

TEST_P(CrewTest, NoTwoPassesShareAMember) {
  std::vector<std::atomic<int>> at_work(crew_.size());
  std::atomic<int> clashes = 0;
  for (int loop = 0; loop < 200; ++loop) {
    crew_.ForEach(10, [&](size_t, size_t member) {
      if (++at_work[member] > 1) ++clashes;
      std::this_thread::yield();
      --at_work[member];
    });
  }
  EXPECT_EQ(clashes, 0);
}

TEST_P(CrewTest, AnExceptionEndsTheLoopAndNotTheCrew) {
  std::atomic<int> passes = 0;
  const auto loop = [&] {
    crew_.ForEach(1000, [&](size_t pass, size_t) {
      if (pass == 3) throw std::runtime_error("pass 3");
      ++passes;
      std::this_thread::yield();
    });
  };
  EXPECT_THROW(loop(), std::runtime_error);
  EXPECT_GE(passes, 3) << "they began before the one that failed";
  if (GetParam() == 1) {
    EXPECT_EQ(passes, 3);
  }
  passes = 0;
  crew_.ForEach(50, [&](size_t, size_t) { ++passes; });
  EXPECT_EQ(passes, 50);
}

TEST(CrewSizeTest, TwoOfACrewWorkAtATime) {
  Crew crew("test", 2);
  std::atomic<int> arrived = 0;
  crew.ForEach(2, [&](size_t, size_t) {
    ++arrived;
    while (arrived < 2) std::this_thread::yield();
  });
  EXPECT_EQ(arrived, 2);
}

TEST(CrewSizeTest, ThereIsNoCrewOfNobody) { EXPECT_THROW(Crew("test", 0), InternalError); }

}  // namespace
}  // namespace dynamic_slam
