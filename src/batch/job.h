#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "record/plan_record.h"

namespace tomofield::batch {

/// The time and the memory of a job, as `tomofield reconstruct --plan` estimates them.
struct Needs {
  std::int64_t memory_bytes_of_one_thread = 0;
  std::int64_t memory_bytes_a_thread = 0;  ///< of every further thread
  std::optional<double> core_seconds;      ///< processor time, if it can be estimated
  double sample_steps = 0;                 ///< the size of the job, the same on every machine
  std::int64_t result_bytes = 0;           ///< of the files that stay
  std::int64_t disk_bytes = 0;             ///< at most, while it runs
  bool open_variation = false;   ///< nobody has given the penalty and weight of total variation
  bool open_spike_rank = false;  ///< nor the limit of spikes
  bool open_prior = false;       ///< nor the prior
  int num_trials = 0;            ///< that would choose what is open

  std::int64_t memory_bytes(int threads) const {
    return memory_bytes_of_one_thread + (threads - 1) * memory_bytes_a_thread;
  }
};

/// The files that a job reads and writes.
struct JobFiles {
  std::vector<std::filesystem::path> inputs, results;
  std::string relion_tomogram;  ///< in the row that it writes for RELION, or empty
};

/// The reconstruction of one series.
struct Job {
  std::string name;
  std::filesystem::path output;      ///< the tomogram
  std::vector<std::string> command;  ///< words after `tomofield`, with the output's name
  Needs needs;
  bool is_skipped = false;  ///< its results were there before
  JobFiles files;           ///< those of its plan; a list of jobs does not have them
  bool is_joined = false;   ///< its row for RELION goes to the table of the batch
  bool replaces = false;    ///< results that were there before the batch (--overwrite)
};

/// All jobs of a batch, in the order of its series.
struct JobList {
  std::vector<Job> jobs;
  bool overwrites = false;  ///< replace what other runs have left
  /// When its batch began, in nanoseconds since 1970, which tells it from others in its folder.
  std::int64_t began_ns = 0;
  bool chooses = false;  ///< trials of some jobs choose for all, before the others run
};

Needs needs_of(const record::PlanRecord& plan);

/// Writes the list of a batch, from which the tasks of a job array read their jobs. Throws Error if
/// it cannot be written, and for words that are no UTF-8.
void write_jobs(const std::filesystem::path& file, const JobList& list);
/// Throws Error for words of a list that write_jobs() cannot write.
void require_words(const JobList& list);
/// Reads what write_jobs() has written. Throws Error for anything else.
JobList read_jobs(const std::filesystem::path& file);
/// Returns the jobs of an earlier batch; none if the file is not there, damaged, or of an earlier
/// version.
std::vector<Job> find_jobs(const std::filesystem::path& file);
/// Returns the commands of a list that an earlier version may have written, by the names of their
/// jobs. Throws Error, with what to do, if there are none.
std::map<std::string, std::vector<std::string>> read_commands(const std::filesystem::path& file);

/// Returns whether the results of a job are there: the tomogram and its metrics.
bool has_results(const std::filesystem::path& output);
/// Returns what is wrong with these results, or an empty text if the tomogram has the size that its
/// header states and the metrics are those of a run.
std::string fault_of_results(const std::filesystem::path& output);
/// Returns what a user can do if the files of a job are in its way: to remove those that there are.
std::string advice_on_files(const std::filesystem::path& output);
/// Returns why a run failed as a batch says it. A run that finds other files in its way advises to
/// overwrite them or to take another name, which a batch would do for all series.
std::string reason_in_batch(const std::string& said, const std::filesystem::path& output);
/// Returns when a checkpoint or the trials were last written, or nothing if there are none.
std::optional<std::filesystem::file_time_type> last_progress(const std::filesystem::path& output);
/// Returns whether a fit has begun: there is a checkpoint, or trials of --tune.
bool has_checkpoint(const std::filesystem::path& output);
/// Returns whether a run can continue: there is a checkpoint, an alignment, or the lock of a run
/// that was killed before its first checkpoint, whose pictures may be in the way.
bool can_resume(const std::filesystem::path& output);

/// A run may continue or replace the files of an earlier one.
struct EarlierFiles {
  bool resumes = false;     ///< continue from them if that is possible
  bool overwrites = false;  ///< else replace them
};
/// Returns the words that run a job with some threads; `program` is tomofield itself.
std::vector<std::string> command_of(const std::filesystem::path& program, const Job& job,
                                    int threads, EarlierFiles earlier);

}  // namespace tomofield::batch
