#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>

namespace tomofield::base {

/// Records what a run does and when, for `--trace`. There is one record for the process. It has the
/// spans (TraceSpan), the loops of parallel_for, and the tasks of those loops while a TraceTasks
/// exists. Nothing is recorded before start().
namespace trace {

/// Begins an empty record, with time 0.
void start();
inline std::atomic<bool> is_on = false;
/// Writes the record as a Chrome trace (JSON, "Trace Event Format", for chrome://tracing or
/// ui.perfetto.dev). Times are microseconds since start(); `tdur` is the time
/// that the thread itself ran between the beginning and the end of an event. A loop has the number
/// of its tasks and the seconds that all and the longest of them took. Tasks and loops name the
/// loop and the task in which they ran, so that a reader can rebuild what waited for what. Throws
/// Error if the file cannot be written.
void write(const std::filesystem::path& path);

}  // namespace trace

/// Records the time from its construction to its destruction as one span.
class TraceSpan {
 public:
  /// `name` must be a literal.
  explicit TraceSpan(const char* name);
  ~TraceSpan();
  TraceSpan(const TraceSpan&) = delete;
  TraceSpan& operator=(const TraceSpan&) = delete;

 private:
  const char* name_;
  std::int64_t begin_, processor_begin_ = 0;
};

/// Records each task of the loops of parallel_for that begin while it exists, if `is_wanted`. One
/// at a time.
class TraceTasks {
 public:
  explicit TraceTasks(bool is_wanted);
  ~TraceTasks();
  TraceTasks(const TraceTasks&) = delete;
  TraceTasks& operator=(const TraceTasks&) = delete;

 private:
  bool is_wanted_;
};

/// Records a loop of parallel_for, which makes one of these for each call.
class TraceLoop {
 public:
  TraceLoop(const char* name, std::int64_t count);
  ~TraceLoop();
  TraceLoop(const TraceLoop&) = delete;
  TraceLoop& operator=(const TraceLoop&) = delete;

  /// Calls body() as task `index` of the loop, on thread `thread`.
  template <typename Body>
  void run_task(std::int64_t index, int thread, const Body& body) {
    if (id_ < 0) return body();
    const Task task(*this, index, thread);
    body();
  }

 private:
  struct Task {
    Task(TraceLoop& of, std::int64_t index, int thread);
    ~Task();
    TraceLoop& loop;
    std::int64_t index, id, outer_task, begin, processor_begin;
    int thread;
    bool is_outer_recorded;
  };

  const char* name_;
  std::int64_t count_, id_ = -1, outer_task_ = -1, begin_ = 0, processor_begin_ = 0;
  bool has_tasks_;
  std::atomic<std::int64_t> busy_ = 0, longest_ = 0;  // nanoseconds
};

}  // namespace tomofield::base
