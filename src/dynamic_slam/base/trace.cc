#include "dynamic_slam/base/trace.h"

#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "dynamic_slam/base/mutex.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

static_assert(std::chrono::steady_clock::period::den == 1'000'000'000, "time stamps are taken as ns");

struct Event {
  const char* name;
  int64_t start_ns;
  int64_t value;  // duration in ns, or of a counter
  bool is_counter;
};

// What one thread has collected. Only the trace's start and end meet the thread at this lock.
struct ThreadBuffer {
  Mutex mutex;
  const char* name DS_GUARDED_BY(mutex) = nullptr;
  std::vector<Event> events DS_GUARDED_BY(mutex);
  size_t max_events DS_GUARDED_BY(mutex) = 0;
  size_t dropped DS_GUARDED_BY(mutex) = 0;
};

// Buffers of all threads that have had an event, in that order. A buffer outlives its thread.
struct Registry {
  Mutex mutex;
  std::vector<std::shared_ptr<ThreadBuffer>> buffers DS_GUARDED_BY(mutex);
  size_t max_events DS_GUARDED_BY(mutex) = 0;
  int64_t start_ns DS_GUARDED_BY(mutex) = 0;
};

// Never destroyed: threads may end after main.
Registry& TheRegistry() {
  static Registry& registry = *new Registry;
  return registry;
}

thread_local const char* thread_name = nullptr;
thread_local std::shared_ptr<ThreadBuffer> thread_buffer;

ThreadBuffer& BufferOfThread() {
  if (thread_buffer == nullptr) {
    thread_buffer = std::make_shared<ThreadBuffer>();
    Registry& registry = TheRegistry();
    MutexLock lock(registry.mutex);
    MutexLock buffer_lock(thread_buffer->mutex);
    thread_buffer->name = thread_name;
    thread_buffer->max_events = registry.max_events;
    registry.buffers.push_back(thread_buffer);
  }
  return *thread_buffer;
}

void Add(const Event& event) {
  ThreadBuffer& buffer = BufferOfThread();
  MutexLock lock(buffer.mutex);
  if (buffer.events.size() < buffer.max_events) {
    buffer.events.push_back(event);
  } else {
    ++buffer.dropped;
  }
}

// The format counts in microseconds.
std::string Microseconds(int64_t ns) { return fmt::format("{}.{:03}", ns / 1000, ns % 1000); }

void Append(const Event& event, size_t thread, int64_t trace_start_ns, std::string* json) {
  const auto out = std::back_inserter(*json);
  const std::string name = Quoted(event.name), start = Microseconds(event.start_ns - trace_start_ns);
  if (event.is_counter) {
    fmt::format_to(out, R"({{"ph":"C","pid":1,"tid":{},"ts":{},"name":{},"args":{{"value":{}}}}})", thread,
                   start, name, event.value);
  } else {
    fmt::format_to(out, R"({{"ph":"X","pid":1,"tid":{},"ts":{},"dur":{},"name":{}}})", thread, start,
                   Microseconds(event.value), name);
  }
}

}  // namespace

namespace internal {

void AddTraceScope(const char* name, int64_t start_ns) {
  Add({name, start_ns, TraceNow_ns() - start_ns, false});
}

}  // namespace internal

void StartTrace(size_t max_events_per_thread) {
  Registry& registry = TheRegistry();
  MutexLock lock(registry.mutex);
  // A buffer that only the registry still has is of a thread that has ended.
  std::erase_if(registry.buffers, [](const auto& buffer) { return buffer.use_count() == 1; });
  for (const std::shared_ptr<ThreadBuffer>& buffer : registry.buffers) {
    MutexLock buffer_lock(buffer->mutex);
    buffer->events.clear();
    buffer->max_events = max_events_per_thread;
    buffer->dropped = 0;
  }
  registry.max_events = max_events_per_thread;
  registry.start_ns = internal::TraceNow_ns();
  internal::trace_is_on.store(true, std::memory_order_relaxed);
}

TraceSummary WriteTrace(const std::filesystem::path& file) {
  internal::trace_is_on.store(false, std::memory_order_relaxed);
  TraceSummary summary;
  std::string json = "{\"displayTimeUnit\":\"ms\",\"traceEvents\":[\n";
  json += R"({"ph":"M","pid":1,"name":"process_name","args":{"name":"dynamic_slam"}})";
  std::string dropped;
  {
    Registry& registry = TheRegistry();
    MutexLock lock(registry.mutex);
    size_t thread = 0;
    for (const std::shared_ptr<ThreadBuffer>& buffer : registry.buffers) {
      MutexLock buffer_lock(buffer->mutex);
      ++thread;
      const std::string name = buffer->name != nullptr ? buffer->name : fmt::format("thread {}", thread);
      json += fmt::format(
          ",\n{{\"ph\":\"M\",\"pid\":1,\"tid\":{},\"name\":\"thread_name\",\"args\":{{\"name\":{}}}}}",
          thread, Quoted(name));
      for (const Event& event : buffer->events) {
        if (event.start_ns < registry.start_ns) continue;  // begun before this trace
        json += ",\n";
        Append(event, thread, registry.start_ns, &json);
        ++summary.events;
      }
      summary.dropped += buffer->dropped;
      if (buffer->dropped > 0) {
        dropped += fmt::format("{}{}:{}", dropped.empty() ? "" : ",",
                               Quoted(fmt::format("{} (tid {})", name, thread)), buffer->dropped);
      }
    }
  }
  json += fmt::format("\n],\"otherData\":{{\"dropped_events\":{{{}}}}}}}\n", dropped);
  WriteFileAtomically(file, json);
  return summary;
}

void TraceCounter(TraceName name, int64_t value) {
  if (!internal::trace_is_on.load(std::memory_order_relaxed)) return;
  Add({name.text, internal::TraceNow_ns(), value, true});
}

void TraceThreadName(TraceName name) {
  thread_name = name.text;
  if (thread_buffer == nullptr) return;
  MutexLock lock(thread_buffer->mutex);
  thread_buffer->name = name.text;
}

}  // namespace dynamic_slam
