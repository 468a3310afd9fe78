#pragma once

#include <chrono>
#include <ctime>
#include <functional>
#include <string>
#include <utility>

namespace tomofield::base {

/// The progress of a long computation. A sink receives it and may draw it.
struct ProgressReport {
  double fraction_done = 0.0;
  double seconds_elapsed = 0.0;
  double seconds_left = 0.0;
  std::string detail;  ///< a few words on the state, such as the loss
};
/// Returns a report whose remaining time is extrapolated from `fraction_done`, which is above 0.
inline ProgressReport progress_at(double fraction_done, double seconds_elapsed,
                                  std::string detail) {
  return {fraction_done, seconds_elapsed, seconds_elapsed * (1 - fraction_done) / fraction_done,
          std::move(detail)};
}
using ProgressSink = std::function<void(const ProgressReport&)>;

/// Returns a sink for a part of a computation that another sink receives: the part begins at the
/// fraction `begin` of the whole and takes `size` of it. Details begin with `name`. The part must
/// not outlive `whole`. Without a `whole` there is none.
inline ProgressSink part_of(const ProgressSink& whole, double begin, double size,
                            std::string name) {
  if (!whole) return {};
  return [&whole, begin, size, name = std::move(name)](const ProgressReport& part) {
    ProgressReport report = part;
    report.fraction_done = begin + size * part.fraction_done;
    const double seconds_of_part = part.seconds_elapsed + part.seconds_left;
    report.seconds_left += seconds_of_part * (1 - begin - size) / size;
    report.detail = name + "  " + part.detail;
    whole(report);
  };
}

/// Is thrown by every process of a computation after a stop was requested of one of them.
struct StopRequested {};

/// Sets what long work calls between its parts where nobody follows its progress, as in sampling.
/// What it throws ends the work. Any thread calls it, and often. Set it before any work starts.
void set_interruption(std::function<void()> check);

/// Calls what was set, if anything.
void allow_interruption();

/// Sets what every parallel_for calls before each of its bodies, for work that may end anywhere. It
/// is as set_interruption() says.
void set_loop_interruption(std::function<void()> check);

/// Calls what was set for loops, if anything.
void allow_loop_interruption();

/// Returns a duration as "2 h 05 min", "3 min 20 s" or "12 s".
std::string time_text(double seconds);

/// Measures the wall-clock time since it was made or restarted.
class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  void restart() { start_ = std::chrono::steady_clock::now(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Measures the processor time of all threads of this process since it was made. Other programs on
/// the machine change it little.
class ProcessorStopwatch {
 public:
  double seconds() const { return now() - start_; }

 private:
  static double now() {
    timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }
  double start_ = now();
};

}  // namespace tomofield::base
