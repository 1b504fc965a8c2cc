#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>

namespace dynamic_slam {

// Where the time goes: scopes, counters and threads, written in the trace event format of Chrome, which
// chrome://tracing and ui.perfetto.dev show. While no trace is taken, a scope costs one relaxed atomic load.
//
//   void LocalMapper::Adjust() {
//     DS_TRACE("mapping/adjust");  // until the end of the block

// A text that lives as long as the program: events keep the pointer only.
struct TraceName {
  consteval TraceName(const char* name) : text(name) {}  // NOLINT: literals are meant to convert
  const char* text;
};

// What a thread keeps at most, 16 MB; events above that are counted and said to be dropped.
inline constexpr size_t kMaxTraceEventsPerThread = size_t{1} << 19;

struct TraceSummary {
  size_t events = 0;   // in the file
  size_t dropped = 0;  // for want of room
};

// Begins a trace and forgets what an earlier one has collected.
void StartTrace(size_t max_events_per_thread = kMaxTraceEventsPerThread);

// Ends the trace and writes it. Scopes that are still open are not in it. Throws InputError when the file
// cannot be written.
TraceSummary WriteTrace(const std::filesystem::path& file);

// The value of a counter from now on.
void TraceCounter(TraceName name, int64_t value);

// Names the calling thread; may come before StartTrace.
void TraceThreadName(TraceName name);

namespace internal {

inline std::atomic<bool> trace_is_on{false};

inline int64_t TraceNow_ns() { return std::chrono::steady_clock::now().time_since_epoch().count(); }

void AddTraceScope(const char* name, int64_t start_ns);

}  // namespace internal

// The time from its construction to its destruction; see DS_TRACE.
class TraceScope {
 public:
  explicit TraceScope(TraceName name) {
    if (internal::trace_is_on.load(std::memory_order_relaxed)) [[unlikely]] {
      name_ = name.text;
      start_ns_ = internal::TraceNow_ns();
    }
  }
  ~TraceScope() {
    if (name_ != nullptr) [[unlikely]]
      internal::AddTraceScope(name_, start_ns_);
  }
  TraceScope(const TraceScope&) = delete;
  TraceScope& operator=(const TraceScope&) = delete;

 private:
  const char* name_ = nullptr;
  int64_t start_ns_ = 0;
};

}  // namespace dynamic_slam

#define DS_TRACE_JOIN_(a, b) a##b
#define DS_TRACE_JOIN(a, b) DS_TRACE_JOIN_(a, b)
#define DS_TRACE(name) const ::dynamic_slam::TraceScope DS_TRACE_JOIN(trace_scope_, __LINE__)(name)
