#include "dynamic_slam/base/trace.h"

#include <atomic>
#include <chrono>
#include <filesystem>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;

class Trace : public ::testing::Test {
 protected:
  // Ends the trace, writes and parses it.
  json Write() {
    summary_ = WriteTrace(file_);
    return json::parse(ReadFile(file_));
  }

  // The events of a kind (ph), in the order of the file.
  static std::vector<json> Events(const json& trace, const std::string& kind) {
    std::vector<json> events;
    for (const json& event : trace["traceEvents"]) {
      if (event["ph"] == kind) events.push_back(event);
    }
    return events;
  }

  static std::vector<std::string> Names(const std::vector<json>& events) {
    std::vector<std::string> names;
    for (const json& event : events) names.push_back(event["name"]);
    return names;
  }

  // Thread name by tid.
  static std::map<int, std::string> Threads(const json& trace) {
    std::map<int, std::string> threads;
    for (const json& event : Events(trace, "M")) {
      if (event["name"] == "thread_name") threads[event["tid"]] = event["args"]["name"];
    }
    return threads;
  }

  const std::filesystem::path file_ =
      std::filesystem::path(::testing::TempDir()) /
      (std::string("dynamic_slam_trace_") + ::testing::UnitTest::GetInstance()->current_test_info()->name() +
       ".json");
  TraceSummary summary_;
};

TEST_F(Trace, ScopesNest) {
  StartTrace();
  {
    DS_TRACE("outer");
    { DS_TRACE("first"); }
    { DS_TRACE("second \"quoted\" \\"); }
  }
  const json trace = Write();
  const std::vector<json> scopes = Events(trace, "X");
  // In the order of their ends.
  ASSERT_THAT(Names(scopes), ElementsAre("first", "second \"quoted\" \\", "outer"));
  const auto start = [&](size_t i) { return scopes[i]["ts"].get<double>(); };
  const auto end = [&](size_t i) { return start(i) + scopes[i]["dur"].get<double>(); };
  constexpr double kRounding_us = 1e-6;
  EXPECT_LE(start(2), start(0));
  EXPECT_LE(end(0), start(1) + kRounding_us);
  EXPECT_LE(end(1), end(2) + kRounding_us);
  EXPECT_GE(start(2), 0);
  EXPECT_EQ(scopes[0]["tid"], scopes[2]["tid"]);
  EXPECT_EQ(summary_.events, 3u);
  EXPECT_EQ(summary_.dropped, 0u);
}

TEST_F(Trace, DurationsAreInMicroseconds) {
  StartTrace();
  {
    DS_TRACE("wait");
    const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(2);
    while (std::chrono::steady_clock::now() < until) {
    }
  }
  const json trace = Write();
  EXPECT_GE(Events(trace, "X").at(0)["dur"].get<double>(), 2000);
}

TEST_F(Trace, NothingIsCollectedWhileItIsOff) {
  { DS_TRACE("before"); }
  TraceCounter("before", 1);
  StartTrace();
  { DS_TRACE("during"); }
  Write();
  { DS_TRACE("after"); }
  TraceCounter("after", 1);
  const json trace = Write();
  EXPECT_THAT(Names(Events(trace, "X")), ElementsAre("during"));
  EXPECT_TRUE(Events(trace, "C").empty());
}

TEST_F(Trace, AScopeThatBeganBeforeTheTraceIsLeftOut) {
  StartTrace();
  {
    DS_TRACE("across");
    StartTrace();
    { DS_TRACE("inside"); }
  }
  const json trace = Write();
  EXPECT_THAT(Names(Events(trace, "X")), ElementsAre("inside"));
}

TEST_F(Trace, CountersHaveValues) {
  StartTrace();
  for (const int n : {3, 0}) TraceCounter("keyframes waiting", n);
  const json trace = Write();
  const std::vector<json> counters = Events(trace, "C");
  ASSERT_THAT(Names(counters), ElementsAre("keyframes waiting", "keyframes waiting"));
  EXPECT_EQ(counters[0]["args"]["value"], 3);
  EXPECT_EQ(counters[1]["args"]["value"], 0);
  EXPECT_LE(counters[0]["ts"].get<double>(), counters[1]["ts"].get<double>());
}

TEST_F(Trace, ThreadsThatHaveEndedKeepEventsAndName) {
  constexpr int kScopes = 1000;
  StartTrace();
  TraceThreadName("main");
  { DS_TRACE("here"); }
  const auto work = [] {
    for (int i = 0; i < kScopes; ++i) {
      DS_TRACE("work");
      TraceCounter("done", i);
    }
  };
  std::thread named([&] {
    TraceThreadName("mapping");
    work();
  });
  std::thread renamed([&] {
    work();
    TraceThreadName("loop");
  });
  std::thread nameless(work);
  named.join();
  renamed.join();
  nameless.join();
  const json trace = Write();

  const std::map<int, std::string> threads = Threads(trace);
  std::map<std::string, int> scopes;
  for (const json& event : Events(trace, "X")) ++scopes[threads.at(event["tid"])];
  ASSERT_EQ(scopes.size(), 4u);
  EXPECT_EQ(scopes["main"], 1);
  EXPECT_EQ(scopes["mapping"], kScopes);
  EXPECT_EQ(scopes["loop"], kScopes);
  scopes.erase("main");
  scopes.erase("mapping");
  scopes.erase("loop");
  EXPECT_THAT(scopes.begin()->first, ::testing::StartsWith("thread "));

  // The next trace does not know them.
  StartTrace();
  { DS_TRACE("here"); }
  const std::map<int, std::string> next = Threads(Write());
  ASSERT_EQ(next.size(), 1u);
  EXPECT_EQ(next.begin()->second, "main");
}

TEST_F(Trace, IsWrittenWhileThreadsGoOn) {
  StartTrace(1000);
  std::atomic<bool> stop{false};
  std::vector<std::thread> threads;
  for (int i = 0; i < 3; ++i) {
    threads.emplace_back([&stop] {
      while (!stop) {
        DS_TRACE("busy");
        TraceCounter("busy", 1);
      }
    });
  }
  for (int i = 0; i < 5; ++i) {
    std::this_thread::yield();
    EXPECT_TRUE(Write().contains("traceEvents"));
    StartTrace(1000);
  }
  stop = true;
  for (std::thread& thread : threads) thread.join();
  Write();
}

TEST_F(Trace, EventsAboveTheLimitAreCounted) {
  StartTrace(5);
  TraceThreadName("main");
  for (int i = 0; i < 12; ++i) DS_TRACE("scope");
  const json trace = Write();
  EXPECT_EQ(Events(trace, "X").size(), 5u);
  EXPECT_EQ(summary_.events, 5u);
  EXPECT_EQ(summary_.dropped, 7u);
  const json& dropped = trace["otherData"]["dropped_events"];
  ASSERT_EQ(dropped.size(), 1u);
  EXPECT_THAT(dropped.begin().key(), ::testing::StartsWith("main (tid "));
  EXPECT_EQ(dropped.begin().value(), 7);
}

TEST_F(Trace, SaysWhyItCannotBeWritten) {
  StartTrace();
  EXPECT_THROW(WriteTrace("/dev/null/trace.json"), InputError);
}

}  // namespace
}  // namespace dynamic_slam
