#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>

namespace tomofield::base {

/// The largest number of threads that can be asked for.
inline constexpr int kMostThreads = 1024;

/// Returns the number of threads that parallel_for uses. By default it is OMP_NUM_THREADS, or else
/// the processors that this process may use (processors.h).
int thread_count();
/// Sets the number of threads; 0 is the default. Throws Error while a ThreadsInUse lives. No loop
/// may run.
void set_thread_count(int count);

/// Keeps the number of threads as it is while it lives: work makes a buffer for each of them before
/// its loops. Every public function of the library that computes has one. Thread-safe.
class ThreadsInUse {
 public:
  ThreadsInUse();
  ~ThreadsInUse();
  ThreadsInUse(const ThreadsInUse&) = delete;
  ThreadsInUse& operator=(const ThreadsInUse&) = delete;
};

/// Makes the default number of threads a share of the processors, for `processes` of one job on
/// this machine. Processes that are bound to different processors do not share.
void share_machine_with(int processes);
/// Returns a sentence with the number of threads, its reason, and whether they are bound to
/// processors.
std::string describe_threads();

/// Returns the index of the calling thread inside a parallel_for, 0 <= index < thread_count().
int thread_index();

namespace detail {
void run_loop(const char* what, std::int64_t count, void (*call)(void*, std::int64_t), void* body);
}

/// Calls body(i) for i in [0, count), in any order, on thread_count() threads. `what` is a literal
/// that names the loop in a trace (trace.h). A body may contain loops: threads that have nothing
/// else to do join in, and a thread that waits for its inner loop works on that loop alone, so that
/// what it holds is never needed twice. Threads that have nothing to do sleep. If bodies throw,
/// some others may not be called, and the first exception is thrown again after all threads have
/// left the loop. Bodies are not called once a stop was asked for (set_loop_interruption()).
/// Results must not depend on which thread runs an index.
template <typename Body>
void parallel_for(const char* what, std::int64_t count, Body&& body) {
  using Plain = std::remove_reference_t<Body>;
  detail::run_loop(
      what, count, [](void* b, std::int64_t i) { (*static_cast<Plain*>(b))(i); },
      const_cast<std::remove_const_t<Plain>*>(&body));
}

/// Returns what belongs to the work of the calling thread: a pointer to something of its caller, or
/// null. In a parallel_for, the threads that help have that of the thread that called it.
inline void*& thread_context() {
  thread_local void* context = nullptr;
  return context;
}

/// Gives the calling thread another context while it lives.
class ContextScope {
 public:
  explicit ContextScope(void* context) : outer_(std::exchange(thread_context(), context)) {}
  ~ContextScope() { thread_context() = outer_; }
  ContextScope(const ContextScope&) = delete;
  ContextScope& operator=(const ContextScope&) = delete;

 private:
  void* outer_;
};

}  // namespace tomofield::base
