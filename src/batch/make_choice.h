#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <vector>

#include "batch/choice.h"
#include "batch/job.h"
#include "batch/run_jobs.h"

namespace tomofield::batch {

/// The files of the trials by which a job chooses for all: what it chose, and what it said.
struct TrialFiles {
  std::filesystem::path answer, log;
};
TrialFiles trial_files_of(const std::filesystem::path& folder, const Job& job);

/// Lets some jobs of a list make their trials, one after another, each with all threads. Stores
/// what they choose together in the folder of the batch, gives it to all jobs that lack it, and
/// writes the list and the summary again. What each of them says goes to logs/choice/NAME.log. A
/// job whose trials fail has no vote. If nobody has one, it warns, and every series chooses for
/// itself. Returns false if it was asked to stop; then nothing is stored. The folder of logs is
/// there.
bool make_choice(const RunOptions& options, const std::vector<std::size_t>& choosing, int threads,
                 JobList& list);

}  // namespace tomofield::batch
