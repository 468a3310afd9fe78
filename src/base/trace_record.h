#pragma once

#include <cstdint>
#include <string>

namespace tomofield::base {

/// An event of a trace (trace.h). Times are in nanoseconds.
struct TraceEvent {
  static constexpr std::int64_t kNone = -1;
  enum class Kind {
    kSpan,  ///< a TraceSpan
    kLoop,  ///< a call of parallel_for
    kTask   ///< a task of such a loop
  } kind;
  const char* name;
  std::int64_t begin, end;          ///< since the start of the trace
  std::int64_t processor;           ///< that the thread ran
  int thread = 0;                   ///< numbers of threads count from 0
  std::int64_t loop = kNone;        ///< number of the loop, or of that of the task
  std::int64_t task = kNone;        ///< number of the task in the trace
  std::int64_t outer_task = kNone;  ///< the task in which a loop ran
  std::int64_t index = 0;           ///< of the task in its loop
  std::int64_t count = 0;           ///< tasks of the loop
  std::int64_t busy = 0;            ///< of all tasks of the loop together
  std::int64_t longest = 0;         ///< of the longest of them
};

/// Returns the object of an event (JSON) as Chrome's "Trace Event Format" has it.
std::string text_of(const TraceEvent& event);

}  // namespace tomofield::base
