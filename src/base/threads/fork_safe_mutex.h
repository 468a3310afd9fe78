#pragma once

#include <sys/types.h>
#include <unistd.h>

#include <atomic>

namespace tomofield::base {

/// A mutex for what all threads of the process share. A process that is forked while another thread
/// holds it finds it free: that thread is not there, and would never unlock it. What the mutex
/// guards must be usable in the middle of a change, or not be needed by such a process.
class ForkSafeMutex {
 public:
  constexpr ForkSafeMutex() = default;
  ForkSafeMutex(const ForkSafeMutex&) = delete;
  ForkSafeMutex& operator=(const ForkSafeMutex&) = delete;

  void lock() {
    const pid_t process = getpid();
    pid_t holder = kNobody;
    while (!holder_.compare_exchange_weak(holder, process)) {
      if (holder == process) holder_.wait(holder);
      if (holder == process) holder = kNobody;  // else its process is this one's parent
    }
  }
  void unlock() {
    holder_ = kNobody;
    holder_.notify_one();
  }

 private:
  static constexpr pid_t kNobody = 0;
  std::atomic<pid_t> holder_ = kNobody;  // the process of the thread that holds it
};

}  // namespace tomofield::base
