#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "batch/job.h"

namespace tomofield::batch {

/// The resources that are free for jobs.
struct Room {
  int threads = 1;
  std::int64_t memory_bytes = 0;
  int jobs = 1;  ///< that may run beside those that do
};

/// A job that is to start.
struct Start {
  std::size_t job = 0;
  int threads = 1;
};

/// Returns the jobs that are not skipped, the one with the most work first: then no large job is
/// left for the end, where it would run alone. Jobs whose work is not known go by their memory.
std::vector<std::size_t> largest_first(const std::vector<Job>& jobs);

/// Returns which of the `waiting` jobs are to start now, in their order, and divides the threads
/// among them. As many start as there are threads and as the memory holds; one that does not fit
/// lets the next ones pass. If `nothing_runs`, at least one starts: it then says itself that there
/// is too little memory.
std::vector<Start> choose_starts(const std::vector<Job>& jobs, std::span<const std::size_t> waiting,
                                 const Room& room, bool nothing_runs);

/// Estimates how long all waiting jobs take by the clock, if each takes its processor time divided
/// by its threads. Returns nothing if the time of one is not known.
std::optional<double> seconds_of_all(const std::vector<Job>& jobs, std::vector<std::size_t> waiting,
                                     const Room& room);

}  // namespace tomofield::batch
