#include "base/parallel.h"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <tbb/task_scheduler_observer.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "base/processors.h"
#include "base/trace.h"

// Debian's TBB is built without the thread sanitizer, which therefore does not see that a task
// begins after the loop and ends before it. These calls tell it. It leaves out the function that
// calls them, which reads what TBB hands over before it can say so.
#if defined(__has_feature)
#if __has_feature(thread_sanitizer)
extern "C" void __tsan_acquire(void* address);
extern "C" void __tsan_release(void* address);
#define TOMOFIELD_HAPPENS_BEFORE(address) __tsan_release(address)
#define TOMOFIELD_HAPPENS_AFTER(address) __tsan_acquire(address)
#define TOMOFIELD_NOT_CHECKED __attribute__((no_sanitize("thread")))
#endif
#endif
#ifndef TOMOFIELD_HAPPENS_BEFORE
#define TOMOFIELD_HAPPENS_BEFORE(address)
#define TOMOFIELD_HAPPENS_AFTER(address)
#define TOMOFIELD_NOT_CHECKED
#endif

namespace tomofield::base {
namespace {

// Another program counts as running if the machine was this busy, in processors, on average over
// the last minute.
constexpr double kIdleLoad = 0.5;

int g_asked_count = 0;  // by set_thread_count()
int g_processes_on_machine = 1;

const Processors& processors() {
  static const Processors found = processors_of_this_process();
  return found;
}

// Returns the processors in this thread's affinity mask.
std::vector<int> processors_in_mask() {
  cpu_set_t mask;
  std::vector<int> list;
  if (sched_getaffinity(0, sizeof mask, &mask) != 0) return list;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu)
    if (CPU_ISSET(cpu, &mask)) list.push_back(cpu);
  return list;
}

// Holds a number of threads and the reason for it.
struct Choice {
  int count;
  std::string reason;
};

Choice choose_count() {
  const Processors& p = processors();
  if (g_asked_count > 0) return {g_asked_count, "as asked for"};
  const char* variable = std::getenv("OMP_NUM_THREADS");
  if (const int wanted = variable ? std::atoi(variable) : 0; wanted > 0)
    return {wanted, "as OMP_NUM_THREADS says"};
  if (p.are_all_usable() && g_processes_on_machine > 1) {
    return {std::max(1, p.online / g_processes_on_machine),
            fmt::format("the share of each of {} processes on this machine with {} processors",
                        g_processes_on_machine, p.online)};
  }
  if (p.usable() < p.allowed) {
    return {p.usable(),
            fmt::format("as the control group grants the time of {:.2g} processors of {}", *p.quota,
                        p.online)};
  }
  if (p.allowed < p.online) {
    return {p.allowed,
            fmt::format("as the affinity mask allows {} of {} processors", p.allowed, p.online)};
  }
  return {p.online, fmt::format("one for each of the machine's processors")};
}

// Says why threads are not bound to processors, or nothing if they are to be bound: the process has
// the machine to itself, and a thread for each processor.
std::string reason_not_to_bind(int count) {
  const Processors& p = processors();
  if (!p.are_all_usable()) return "it may not use the whole machine";
  if (g_processes_on_machine > 1) return "it shares the machine with other processes of its job";
  if (count != p.online || count == 1) return "there is not one for each processor";
  const std::optional<double> load = load_average();
  if (!load) return "the load of the machine is unknown";
  if (*load >= kIdleLoad)
    return fmt::format("other work may be running: the load average is {:.2g}", *load);
  return "";
}

// Binds the threads of an arena to processors, while they are in it.
class Binding : public tbb::task_scheduler_observer {
 public:
  explicit Binding(tbb::task_arena& arena)
      : tbb::task_scheduler_observer(arena), processors_(processors_in_mask()) {
    observe(true);
  }
  ~Binding() override { observe(false); }

  void on_scheduler_entry(bool) override {
    const auto slot = static_cast<std::size_t>(tbb::this_task_arena::current_thread_index());
    if (slot < processors_.size()) bind_to({processors_[slot]});
  }
  void on_scheduler_exit(bool) override { bind_to(processors_); }

 private:
  static void bind_to(const std::vector<int>& processors) {
    cpu_set_t mask;
    CPU_ZERO(&mask);
    for (const int cpu : processors) CPU_SET(cpu, &mask);
    pthread_setaffinity_np(pthread_self(), sizeof mask, &mask);
  }
  std::vector<int> processors_;
};

// The threads of the process. TBB keeps them between loops, and those that find no work sleep.
class Threads {
 public:
  explicit Threads(Choice choice)
      : count_(choice.count),
        limit_(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(count_)),
        arena_(count_, 1),
        why_unbound_(reason_not_to_bind(count_)),
        why_count_(std::move(choice.reason)) {
    if (why_unbound_.empty()) binding_ = std::make_unique<Binding>(arena_);
  }

  int count() const { return count_; }
  std::string description() const {
    return fmt::format("{} thread{}, {}; {}", count_, count_ == 1 ? "" : "s", why_count_,
                       why_unbound_.empty() ? "each is bound to a processor"
                                            : "not bound to processors, since " + why_unbound_);
  }

  void run(const char* what, std::int64_t count, const auto& body) {
    arena_.execute([&] {
      // Without isolation, a thread that waits for an inner loop could take another index of the
      // outer one, and with it the buffers of this thread.
      tbb::this_task_arena::isolate([&] {
        const tbb::blocked_range<std::int64_t> all(0, count, 1);
        const OuterLoop outer(*this);
        if (outer)
          tbb::parallel_for(all, body, partitioner_of_[what]);
        else
          tbb::parallel_for(all, body, tbb::simple_partitioner());
      });
    });
  }

 private:
  // Tells whether a loop is the outermost one of the process. Inner loops and those of a second
  // calling thread are not.
  class OuterLoop {
   public:
    explicit OuterLoop(Threads& all)
        : runs_(all.outer_loop_runs_), is_outer_(!runs_.test_and_set()) {}
    ~OuterLoop() {
      if (is_outer_) runs_.clear();
    }
    OuterLoop(const OuterLoop&) = delete;
    OuterLoop& operator=(const OuterLoop&) = delete;
    explicit operator bool() const { return is_outer_; }

   private:
    std::atomic_flag& runs_;
    bool is_outer_;
  };

  int count_;
  tbb::global_control limit_;
  tbb::task_arena arena_;
  std::string why_unbound_, why_count_;
  std::unique_ptr<Binding> binding_;
  std::atomic_flag outer_loop_runs_ = ATOMIC_FLAG_INIT;
  // Remembers which thread did which part of an outer loop the last time, so that the same thread
  // works on the same memory, which lies near it.
  std::map<const char*, tbb::affinity_partitioner> partitioner_of_;
};

std::unique_ptr<Threads>& current_threads() {
  static std::unique_ptr<Threads> threads;
  return threads;
}

Threads& threads() {
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  std::unique_ptr<Threads>& current = current_threads();
  if (!current) current = std::make_unique<Threads>(choose_count());
  return *current;
}

}  // namespace

int thread_count() { return threads().count(); }

void set_thread_count(int count) {
  g_asked_count = std::max(count, 0);
  current_threads().reset();
}

void share_machine_with(int processes) {
  g_processes_on_machine = std::max(1, processes);
  current_threads().reset();
}

std::string describe_threads() { return threads().description(); }

int thread_index() { return std::max(0, tbb::this_task_arena::current_thread_index()); }

void detail::run_loop(const char* what, std::int64_t count, void (*call)(void*, std::int64_t),
                      void* body) {
  if (count <= 0) return;
  TraceLoop loop(what, count);
  Threads& all = threads();
  if (all.count() == 1) {
    for (std::int64_t i = 0; i < count; ++i) loop.run_task(i, 0, [&] { call(body, i); });
    return;
  }
  TOMOFIELD_HAPPENS_BEFORE(body);
  all.run(what, count, [&](const tbb::blocked_range<std::int64_t>& range) TOMOFIELD_NOT_CHECKED {
    TOMOFIELD_HAPPENS_AFTER(body);
    for (std::int64_t i = range.begin(); i < range.end(); ++i)
      loop.run_task(i, thread_index(), [&] { call(body, i); });
    TOMOFIELD_HAPPENS_BEFORE(&loop);
  });
  TOMOFIELD_HAPPENS_AFTER(&loop);
}

}  // namespace tomofield::base
