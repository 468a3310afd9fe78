#include "base/threads/parallel.h"

#include <fmt/format.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "base/system/processors.h"
#include "base/threads/fork_safe_mutex.h"
#include "base/threads/stoppable_loops.h"
#include "base/threads/worker_threads.h"
#include "base/trace.h"
#include "tomofield/error.h"

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
  if (const long wanted = variable ? std::strtol(variable, nullptr, 10) : 0; wanted > 0) {
    if (wanted <= kMostThreads) return {static_cast<int>(wanted), "as OMP_NUM_THREADS says"};
    return {kMostThreads,
            fmt::format("the most there can be, since OMP_NUM_THREADS says {}", wanted)};
  }
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

// The threads of the process, and the reason for their number.
class Threads {
 public:
  explicit Threads(Choice choice)
      : wanted_(choice.count),
        why_unbound_(reason_not_to_bind(choice.count)),
        why_count_(std::move(choice.reason)),
        workers_(choice.count, why_unbound_.empty() ? processors_in_mask() : std::vector<int>{}) {}

  WorkerThreads& workers() { return workers_; }
  std::string description() const {
    const int count = workers_.count();
    return fmt::format("{} thread{}, {}{}; {}", count, count == 1 ? "" : "s", why_count_,
                       count < wanted_ ? fmt::format(" (the system grants no {})", wanted_) : "",
                       why_unbound_.empty() ? "each is bound to a processor"
                                            : "not bound to processors, since " + why_unbound_);
  }

 private:
  int wanted_;
  std::string why_unbound_, why_count_;
  WorkerThreads workers_;
};

// Ends threads. A process that was forked has none of its parent's threads, and leaves alone what
// they may have locked.
struct EndThreads {
  pid_t process = getpid();
  void operator()(const Threads* threads) const {
    if (process == getpid()) delete threads;
  }
};
using OwnThreads = std::unique_ptr<Threads, EndThreads>;

OwnThreads& current_threads() {
  static OwnThreads threads;
  return threads;
}

// Counts those who use the threads. A process that was forked has none of its parent's, and would
// wait for ever for a lock that one of them held.
class Users {
 public:
  void enter() {
    for (int count = here(); !count_.compare_exchange_weak(count, count + 1);) count = here();
  }
  void leave() {
    int count = here();
    while (count > 0 && !count_.compare_exchange_weak(count, count - 1)) continue;
  }
  /// Calls change() while nobody uses the threads. Returns false if somebody does.
  template <typename Change>
  bool change_alone(const Change& change) {
    int nobody = here();
    if (nobody > 0 || !count_.compare_exchange_strong(nobody, kChanging)) return false;
    change();
    count_ = 0;
    return true;
  }

 private:
  static constexpr int kChanging = -1;

  // Returns the number of users, when the threads are not changed.
  int here() {
    if (process_.exchange(getpid()) != getpid()) count_ = 0;
    int count = count_;
    for (; count == kChanging; count = count_) std::this_thread::yield();
    return count;
  }

  std::atomic<int> count_ = 0;
  std::atomic<pid_t> process_ = 0;
};

Users& users() {
  static Users of_the_threads;
  return of_the_threads;
}

Threads& threads() {
  static ForkSafeMutex mutex;
  const std::lock_guard lock(mutex);
  OwnThreads& current = current_threads();
  if (!current || current.get_deleter().process != getpid())
    current = OwnThreads(new Threads(choose_count()));
  return *current;
}

}  // namespace

int thread_count() { return threads().workers().count(); }

void set_thread_count(int count) {
  const bool is_set = users().change_alone([count] {
    g_asked_count = std::max(count, 0);
    current_threads().reset();
  });
  if (!is_set)
    throw Error(
        "the number of threads stays while a call of tomofield works, in another thread or in "
        "that of a callback: set it before or after");
}

ThreadsInUse::ThreadsInUse() { users().enter(); }

ThreadsInUse::~ThreadsInUse() { users().leave(); }

void share_machine_with(int processes) {
  g_processes_on_machine = std::max(1, processes);
  current_threads().reset();
}

std::string describe_threads() { return threads().description(); }

int thread_index() { return WorkerThreads::number(); }

void detail::run_loop(const char* what, std::int64_t count, void (*call)(void*, std::int64_t),
                      void* body) {
  if (count <= 0) return;
  TraceLoop loop(what, count);
  void* const context = thread_context();
  const auto run_index = [&](std::int64_t i) {
    allow_loop_interruption();
    StoppableLoops::check();
    const ContextScope scope(context);
    loop.run_task(i, thread_index(), [&] { call(body, i); });
  };
  WorkerThreads& workers = threads().workers();
  if (workers.count() == 1 || count == 1) {
    for (std::int64_t i = 0; i < count; ++i) run_index(i);
    return;
  }
  using Body = decltype(run_index);
  workers.run(
      count, [](const void* of_loop, std::int64_t i) { (*static_cast<const Body*>(of_loop))(i); },
      &run_index);
}

}  // namespace tomofield::base
