#include "batch/packing.h"

#include <algorithm>
#include <utility>

namespace tomofield::batch {
namespace {

// Returns the threads of the job with this index among `count` jobs that share `threads`.
int share_of(int threads, int index, int count) {
  return threads / count + (index < threads % count ? 1 : 0);
}

// Returns `count` jobs that fit together, or fewer if no more do.
std::vector<Start> fitting(const std::vector<Job>& jobs, std::span<const std::size_t> waiting,
                           const Room& room, int count) {
  std::vector<Start> starts;
  std::int64_t left = room.memory_bytes;
  for (const std::size_t job : waiting) {
    const int threads = share_of(room.threads, static_cast<int>(starts.size()), count);
    const std::int64_t needed = jobs[job].needs.memory_bytes(threads);
    if (needed > left) continue;
    starts.push_back({job, threads});
    left -= needed;
    if (std::ssize(starts) == count) break;
  }
  return starts;
}

}  // namespace

std::vector<std::size_t> largest_first(const std::vector<Job>& jobs) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < jobs.size(); ++i)
    if (!jobs[i].is_skipped) order.push_back(i);
  const auto size = [&](std::size_t i) {
    return std::pair(jobs[i].needs.sample_steps, jobs[i].needs.memory_bytes_of_one_thread);
  };
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return size(a) > size(b); });
  return order;
}

std::vector<Start> choose_starts(const std::vector<Job>& jobs, std::span<const std::size_t> waiting,
                                 const Room& room, bool nothing_runs) {
  if (waiting.empty()) return {};
  const int most =
      static_cast<int>(std::min({std::ssize(waiting), static_cast<std::ptrdiff_t>(room.threads),
                                 static_cast<std::ptrdiff_t>(room.jobs)}));
  for (int count = most; count > 0; --count) {
    std::vector<Start> starts = fitting(jobs, waiting, room, count);
    if (std::ssize(starts) == count) return starts;
  }
  if (nothing_runs) return {{waiting.front(), 1}};
  return {};
}

std::optional<double> seconds_of_all(const std::vector<Job>& jobs, std::vector<std::size_t> waiting,
                                     const Room& room) {
  struct Running {
    double end;
    Start start;
  };
  const auto memory = [&](const Start& start) {
    return jobs[start.job].needs.memory_bytes(start.threads);
  };
  if (std::ranges::any_of(waiting, [&](std::size_t job) { return !jobs[job].needs.core_seconds; }))
    return std::nullopt;
  std::vector<Running> running;
  Room free = room;
  double now = 0;
  while (!waiting.empty() || !running.empty()) {
    for (const Start& start : choose_starts(jobs, waiting, free, running.empty())) {
      std::erase(waiting, start.job);
      running.push_back({now + *jobs[start.job].needs.core_seconds / start.threads, start});
      free = {free.threads - start.threads, free.memory_bytes - memory(start), free.jobs - 1};
    }
    const auto next = std::ranges::min_element(running, {}, &Running::end);
    now = next->end;
    const Start& ended = next->start;
    free = {free.threads + ended.threads, free.memory_bytes + memory(ended), free.jobs + 1};
    running.erase(next);
  }
  return now;
}

}  // namespace tomofield::batch
