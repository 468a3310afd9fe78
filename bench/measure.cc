#include "bench/measure.h"

#include <hwy/targets.h>

#include <algorithm>
#include <ctime>

namespace tomofield::bench {
namespace {

// Returns the CPU time of this thread. The clock on the wall would also count other processes.
double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double seconds_of(const std::function<void()>& run, int calls) {
  const double start = cpu_seconds();
  for (int i = 0; i < calls; ++i) run();
  return (cpu_seconds() - start) / calls;
}

// A short turn is rarely interrupted on a busy machine.
constexpr double kTurnSeconds = 4e-3;

}  // namespace

double Timing::median() const {
  auto sorted = seconds;
  std::sort(sorted.begin(), sorted.end());
  return sorted[sorted.size() / 2];
}

double Timing::minimum() const { return *std::min_element(seconds.begin(), seconds.end()); }

std::vector<Timing> measure(const std::vector<Case>& cases,
                            const std::vector<std::int64_t>& targets, int rounds) {
  std::vector<Timing> timings;
  for (const std::int64_t target : targets) {
    for (std::size_t c = 0; c < cases.size(); ++c) timings.push_back({target, c, {}});
  }
  for (int round = 0; round < rounds; ++round) {
    for (Timing& timing : timings) {
      hwy::SetSupportedTargetsForTest(timing.target);
      const auto& run = cases[timing.which].run;
      const double once = seconds_of(run, 1);  // this call also warms up the caches
      const int calls = std::clamp(static_cast<int>(kTurnSeconds / once), 1, 1000);
      timing.seconds.push_back(seconds_of(run, calls));
    }
  }
  hwy::SetSupportedTargetsForTest(0);
  return timings;
}

}  // namespace tomofield::bench
