#include "base/threads/worker_threads.h"

#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <memory>
#include <system_error>
#include <utility>

#include "base/check.h"

namespace tomofield::base {
namespace {

// A thread looks for work for so long before it sleeps. Waking it takes as long.
constexpr std::chrono::microseconds kPatience{20};

thread_local int t_number = 0;

// Returns true as soon as `is_met` does, or false after some microseconds.
template <typename Condition>
bool soon(const Condition& is_met) {
  const auto until = std::chrono::steady_clock::now() + kPatience;
  while (!is_met())
    if (std::chrono::steady_clock::now() > until) return is_met();
  return true;
}

// Indices [begin, end) that are not taken yet. Its own thread takes the first, and others the last.
class alignas(64) Indices {
 public:
  void set(std::int64_t begin, std::int64_t end) {
    packed_ = static_cast<std::uint64_t>(begin) << 32 | static_cast<std::uint64_t>(end);
  }
  bool is_empty() const { return size_of(packed_.load(std::memory_order_relaxed)) <= 0; }
  // Returns an index, or −1 if there is none.
  std::int64_t take(bool first) {
    std::uint64_t packed = packed_.load(std::memory_order_relaxed);
    for (;;) {
      if (size_of(packed) <= 0) return -1;
      const std::uint64_t rest = first ? packed + (std::uint64_t{1} << 32) : packed - 1;
      if (packed_.compare_exchange_weak(packed, rest, std::memory_order_relaxed))
        return first ? begin_of(packed) : end_of(rest);
    }
  }

 private:
  static std::int64_t begin_of(std::uint64_t packed) {
    return static_cast<std::int64_t>(packed >> 32);
  }
  static std::int64_t end_of(std::uint64_t packed) {
    return static_cast<std::int64_t>(packed & 0xffffffff);
  }
  static std::int64_t size_of(std::uint64_t packed) { return end_of(packed) - begin_of(packed); }

  std::atomic<std::uint64_t> packed_ = 0;
};

}  // namespace

// The loop whose index this thread works on.
thread_local const WorkerThreads::Loop* WorkerThreads::t_loop = nullptr;

class WorkerThreads::Loop {
 public:
  Loop(std::int64_t count, Call call, const void* body, int num_parts)
      : left(count),
        outermost(t_loop ? t_loop->outermost : this),
        depth(t_loop ? t_loop->depth + 1 : 1),
        call_(call),
        body_(body),
        num_parts_(num_parts),
        parts_(std::make_unique<Indices[]>(static_cast<std::size_t>(num_parts))) {
    for (int p = 0; p < num_parts; ++p)
      parts_[static_cast<std::size_t>(p)].set(count * p / num_parts, count * (p + 1) / num_parts);
  }

  bool has_indices() const {
    return std::any_of(parts_.get(), parts_.get() + num_parts_,
                       [](const Indices& part) { return !part.is_empty(); });
  }

  // Calls the body for indices that are left, those of this thread's part first, and returns their
  // number.
  std::int64_t take_part() {
    const Loop* const outer = std::exchange(t_loop, this);
    std::int64_t num_done = 0;
    for (int p = 0; p < num_parts_; ++p) {
      Indices& part = parts_[static_cast<std::size_t>((t_number + p) % num_parts_)];
      const bool is_own = p == 0 || num_parts_ == 1;
      for (std::int64_t i = part.take(is_own); i >= 0; i = part.take(is_own), ++num_done) run(i);
    }
    t_loop = outer;
    return num_done;
  }

  void throw_failure() const {
    if (failure_) std::rethrow_exception(failure_);
  }

  // These change under the mutex of the threads.
  std::atomic<std::int64_t> left;       // indices that are not done
  std::atomic<int> num_helpers = 0;     // threads in the loop, but for its caller
  std::condition_variable is_finished;  // nothing left, and no helpers
  bool is_done() const { return left == 0 && num_helpers == 0; }

  const Loop* const outermost;  // of the loops that this one is in, itself included
  const int depth;

 private:
  void run(std::int64_t index) {
    if (has_failed_) return;
    try {
      call_(body_, index);
    } catch (...) {
      if (!has_failed_.exchange(true)) failure_ = std::current_exception();
    }
  }

  Call call_;
  const void* body_;
  int num_parts_;
  std::unique_ptr<Indices[]> parts_;
  std::atomic<bool> has_failed_ = false;
  std::exception_ptr failure_;
};

int WorkerThreads::number() { return t_number; }

WorkerThreads::WorkerThreads(int count, const std::vector<int>& processors) {
  for (int number = 1; number < count; ++number) {
    try {
      workers_.emplace_back([this, number] { work(number); });
    } catch (const std::system_error&) {
      return;  // those that there are do the same work
    }
    if (processors.empty()) continue;
    cpu_set_t mask;
    CPU_ZERO(&mask);
    CPU_SET(processors[static_cast<std::size_t>(number)], &mask);
    pthread_setaffinity_np(workers_.back().native_handle(), sizeof mask, &mask);
  }
}

WorkerThreads::~WorkerThreads() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  has_work_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

void WorkerThreads::run(std::int64_t count, Call call, const void* body) {
  TOMOFIELD_CHECK(count < std::int64_t{1} << 32, "a loop of fewer than 2^32 indices");
  Loop loop(count, call, body, t_loop ? 1 : this->count());
  {
    const std::lock_guard lock(mutex_);
    loops_.push_back(&loop);
    ++num_begun_;
    for (std::int64_t i = 1; i < std::min<std::int64_t>(count, num_asleep_ + 1); ++i)
      has_work_.notify_one();
  }
  const std::int64_t num_done = loop.take_part();
  {
    const std::lock_guard lock(mutex_);
    std::erase(loops_, &loop);
    loop.left -= num_done;
  }
  if (loop.depth == 1)
    help_until_done(loop);
  else
    soon([&] { return loop.is_done(); });
  {
    std::unique_lock lock(mutex_);
    loop.is_finished.wait(lock, [&] { return loop.is_done(); });
  }
  loop.throw_failure();
}

// Takes part in the loops inside of a loop that is in no other one. Its caller holds nothing that
// they could need. It stays out of the loops of other callers, whose number is 0 as well.
void WorkerThreads::help_until_done(const Loop& loop) {
  while (!loop.is_done()) {
    const std::uint64_t num_begun = num_begun_;
    if (Loop* const inner = join_a_loop(&loop)) {
      leave(*inner, inner->take_part());
      continue;
    }
    const auto has_changed = [&] { return num_begun_ != num_begun || loop.is_done(); };
    if (!soon(has_changed)) sleep_until(has_changed);
  }
}

// Sleeps until a loop begins or ends that changes a condition.
void WorkerThreads::sleep_until(const std::function<bool()>& has_changed) {
  std::unique_lock lock(mutex_);
  ++num_asleep_;
  has_work_.wait(lock, has_changed);
  --num_asleep_;
}

void WorkerThreads::work(int number) {
  t_number = number;
  for (;;) {
    const std::uint64_t num_begun = num_begun_;
    if (Loop* const loop = join_a_loop()) {
      leave(*loop, loop->take_part());
      continue;
    }
    // The loops that there are have no index left. Others may begin.
    const auto has_changed = [&] { return num_begun_ != num_begun || is_ending_; };
    if (!soon(has_changed)) sleep_until(has_changed);
    if (is_ending_) return;
  }
}

// Joins the outermost loop that has indices left, the oldest of several, of those inside of a given
// one, if any; returns nothing if there is none. Outer loops have larger pieces of work.
WorkerThreads::Loop* WorkerThreads::join_a_loop(const Loop* outermost) {
  const std::lock_guard lock(mutex_);
  Loop* chosen = nullptr;
  for (Loop* const loop : loops_) {
    if (outermost && loop->outermost != outermost) continue;
    if ((!chosen || loop->depth < chosen->depth) && loop->has_indices()) chosen = loop;
  }
  if (chosen) ++chosen->num_helpers;
  return chosen;
}

// Leaves a loop after work on some of its indices. The loop may end when the mutex is free again.
void WorkerThreads::leave(Loop& loop, std::int64_t num_done) {
  const std::lock_guard lock(mutex_);
  loop.left -= num_done;
  --loop.num_helpers;
  if (!loop.is_done()) return;
  loop.is_finished.notify_one();
  if (loop.depth == 1) has_work_.notify_all();  // its caller may sleep among the workers
}

}  // namespace tomofield::base
