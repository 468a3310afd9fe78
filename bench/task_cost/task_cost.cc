// Measures what loops and tasks cost that do nothing: bench_task_cost OUTPUT.json [THREADS].
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "base/threads/parallel.h"
#include "base/version.h"

namespace tomofield::bench {
namespace {

// Returns the median of the seconds that run() takes in many rounds. Before each round, the threads
// have had nothing to do for `pause_ms`.
template <typename Run>
double median_seconds(const Run& run, int pause_ms) {
  using Clock = std::chrono::steady_clock;
  constexpr int kRounds = 101;
  std::vector<double> seconds;
  for (int round = 0; round < kRounds; ++round) {
    std::this_thread::sleep_for(std::chrono::milliseconds(pause_ms));
    const Clock::time_point begin = Clock::now();
    run();
    seconds.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
  }
  const auto middle = seconds.begin() + kRounds / 2;
  std::nth_element(seconds.begin(), middle, seconds.end());
  return *middle;
}

constexpr auto kDoNothing = [](std::int64_t) {};

nlohmann::json measure() {
  constexpr std::int64_t kTasks = 10000, kLoops = 100;
  const int threads = base::thread_count();
  const double of_one_task = median_seconds([&] { base::parallel_for("one", 1, kDoNothing); }, 0);
  const double of_tasks =
      median_seconds([&] { base::parallel_for("many", kTasks, kDoNothing); }, 0);
  const double of_inner_loops = median_seconds(
      [&] {
        base::parallel_for("outer", kLoops, [&](std::int64_t) {
          base::parallel_for("inner", kTasks / kLoops, kDoNothing);
        });
      },
      0);
  const double after_sleep =
      median_seconds([&] { base::parallel_for("few", threads, kDoNothing); }, 20);
  return {{"commit", base::source_commit()},
          {"threads", threads},
          {"task_us", 1e6 * threads * (of_tasks - of_one_task) / kTasks},
          {"task_of_inner_loop_us", 1e6 * threads * (of_inner_loops - of_one_task) / kTasks},
          {"loop_us", 1e6 * of_one_task},
          {"loop_of_sleeping_threads_us", 1e6 * after_sleep}};
}

}  // namespace
}  // namespace tomofield::bench

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: bench_task_cost OUTPUT.json [THREADS]\n");
    return 2;
  }
  if (argc > 2) tomofield::base::set_thread_count(std::atoi(argv[2]));
  const nlohmann::json costs = tomofield::bench::measure();
  fmt::print("{}\n", costs.dump(1));
  return std::ofstream(argv[1]) << costs.dump(1) << "\n" ? 0 : 1;
}
