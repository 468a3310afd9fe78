#include "base/trace.h"

#include <time.h>

#include <chrono>
#include <fstream>
#include <mutex>
#include <vector>

#include "base/trace_record.h"
#include "tomofield/error.h"

namespace tomofield::base {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::int64_t kNone = TraceEvent::kNone;

struct Record {
  std::mutex mutex;
  std::vector<TraceEvent> events;
  Clock::time_point start = Clock::now();
  std::atomic<std::int64_t> next_id = 0;
  std::atomic<bool> has_tasks = false;
};
Record& record() {
  static Record the_record;
  return the_record;
}

// The task that this thread runs. A loop in a task lets other threads run parts of that task.
thread_local std::int64_t t_task = kNone;
thread_local bool t_is_task_recorded = false;
thread_local int t_thread = 0;

std::int64_t now() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - record().start)
      .count();
}

// Returns the nanoseconds that this thread has run.
std::int64_t processor_now() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return std::int64_t{1000000000} * time.tv_sec + time.tv_nsec;
}

void add(const TraceEvent& event) {
  const std::lock_guard lock(record().mutex);
  record().events.push_back(event);
}

void raise(std::atomic<std::int64_t>& largest, std::int64_t value) {
  for (std::int64_t known = largest; known < value && !largest.compare_exchange_weak(known, value);)
    continue;
}

}  // namespace

void trace::start() {
  const std::lock_guard lock(record().mutex);
  record().events.clear();
  record().start = Clock::now();
  is_on = true;
}

void trace::write(const std::filesystem::path& path) {
  std::ofstream file(path);
  const std::lock_guard lock(record().mutex);
  file << "{\"traceEvents\":[\n";
  const char* separator = "";
  for (const TraceEvent& event : record().events) {
    file << separator << text_of(event);
    separator = ",\n";
  }
  file << "\n]}\n";
  if (!file.flush()) throw Error("cannot write the trace " + path.string());
}

TraceSpan::TraceSpan(const char* name) : name_(name), begin_(trace::is_on ? now() : kNone) {
  if (begin_ != kNone) processor_begin_ = processor_now();
}

TraceSpan::~TraceSpan() {
  if (begin_ == kNone) return;
  add({.kind = TraceEvent::Kind::kSpan,
       .name = name_,
       .begin = begin_,
       .end = now(),
       .processor = processor_now() - processor_begin_,
       .thread = t_thread});
}

TraceTasks::TraceTasks(bool is_wanted) : is_wanted_(is_wanted && trace::is_on) {
  if (is_wanted_) record().has_tasks = true;
}
TraceTasks::~TraceTasks() {
  if (is_wanted_) record().has_tasks = false;
}

// Without their tasks, loops inside of other loops would fill the record and tell little. All tasks
// of a loop are recorded, or none: one of them may be what begins to want tasks (TraceTasks). A
// loop inside of a task that is not recorded is not recorded either.
TraceLoop::TraceLoop(const char* name, std::int64_t count)
    : name_(name), count_(count), has_tasks_(record().has_tasks) {
  if (!trace::is_on || (t_task != kNone && !t_is_task_recorded)) return;
  id_ = record().next_id++;
  outer_task_ = t_task;
  begin_ = now();
  processor_begin_ = processor_now();
}

TraceLoop::~TraceLoop() {
  if (id_ < 0) return;
  add({.kind = TraceEvent::Kind::kLoop,
       .name = name_,
       .begin = begin_,
       .end = now(),
       .processor = processor_now() - processor_begin_,
       .thread = t_thread,
       .loop = id_,
       .outer_task = outer_task_,
       .count = count_,
       .busy = busy_,
       .longest = longest_});
}

TraceLoop::Task::Task(TraceLoop& of, std::int64_t i, int on_thread)
    : loop(of),
      index(i),
      id(record().next_id++),
      outer_task(t_task),
      begin(now()),
      processor_begin(processor_now()),
      thread(on_thread),
      is_outer_recorded(t_is_task_recorded) {
  t_task = id;
  t_is_task_recorded = loop.has_tasks_;
  t_thread = thread;
}

TraceLoop::Task::~Task() {
  const std::int64_t end = now();
  t_task = outer_task;
  t_is_task_recorded = is_outer_recorded;
  loop.busy_ += end - begin;
  raise(loop.longest_, end - begin);
  if (!loop.has_tasks_) return;
  add({.kind = TraceEvent::Kind::kTask,
       .name = loop.name_,
       .begin = begin,
       .end = end,
       .processor = processor_now() - processor_begin,
       .thread = thread,
       .loop = loop.id_,
       .task = id,
       .index = index});
}

}  // namespace tomofield::base
