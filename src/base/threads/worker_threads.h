#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace tomofield::base {

/// Threads that share out the indices of loops (parallel_for). The thread that calls run() is one
/// of them for the time of its loop.
///
/// Every index is taken by itself, so a thread that the system puts aside holds up no more than the
/// index that it has. A thread that finds nothing to do sleeps after some microseconds, which
/// leaves its processor to others: to a thread of the same loop that has lost its own, among them.
///
/// The caller of an inner loop, when it has no index left to take, waits for the threads that still
/// have one. It does not take part in other loops meanwhile, so that what it holds is never needed
/// twice. Other threads that have nothing to do, and the caller of an outermost loop within
/// it, take part in the outermost loop that has indices left.
class WorkerThreads {
 public:
  /// Starts `count` − 1 threads, for loops on `count` threads, or as many as the system grants.
  /// With `processors`, one for each thread, thread i stays on processor i, but for the calling
  /// one.
  WorkerThreads(int count, const std::vector<int>& processors);
  /// Ends the threads. No loop may run.
  ~WorkerThreads();
  WorkerThreads(const WorkerThreads&) = delete;
  WorkerThreads& operator=(const WorkerThreads&) = delete;

  int count() const { return static_cast<int>(workers_.size()) + 1; }
  /// Returns the number of the calling thread, 0 <= number < count(). A thread that is none of the
  /// workers has number 0.
  static int number();

  /// Calls call(body, index) for every index in [0, count), and returns when all are done. In a
  /// loop that is in no other one, the threads begin at the same places every time. If calls throw,
  /// the remaining indices may be left out, and the first exception is thrown again.
  using Call = void (*)(const void* body, std::int64_t index);
  void run(std::int64_t count, Call call, const void* body);

 private:
  class Loop;
  static thread_local const Loop* t_loop;
  void work(int number);
  Loop* join_a_loop(const Loop* outermost = nullptr);
  void leave(Loop& loop, std::int64_t num_done);
  void help_until_done(const Loop& loop);
  void sleep_until(const std::function<bool()>& has_changed);

  std::mutex mutex_;                  // guards what follows, and who is in which loop
  std::condition_variable has_work_;  // for workers
  std::vector<Loop*> loops_;          // that are not done, in the order of their beginning
  int num_asleep_ = 0;
  std::atomic<std::uint64_t> num_begun_ = 0;  // loops
  std::atomic<bool> is_ending_ = false;
  std::vector<std::thread> workers_;
};

}  // namespace tomofield::base
