#include "batch/planning.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "base/log.h"
#include "base/system/child_process.h"
#include "batch/file_conflicts.h"
#include "batch/placeholders.h"
#include "batch/relion_table.h"
#include "batch/series_list.h"
#include "batch/slurm.h"
#include "batch/state_record.h"
#include "io/lower_extension.h"
#include "io/saving/output_folder.h"
#include "io/saving/output_lock.h"
#include "io/tables/relion_star.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;
using option_table::GivenOption;

GivenOption option_for(const Series& series, GivenOption option, const std::string& where) {
  if (series.is_tomogram && option.flag == kSeriesOption) return option;
  if (option.value) option.value = fill_placeholders(series.input, *option.value, where);
  return option;
}

std::string place_of(const Series& series, const GivenOption& option) {
  return series.source + ", " + option.flag;
}

// Returns the words that check a job and write what it needs to `plan`.
std::vector<std::string> plan_command(const PlanOptions& options, const Job& job,
                                      const fs::path& plan) {
  std::vector<std::string> words =
      command_of(options.program, job, options.threads,
                 {.resumes = options.skips_existing && !job.replaces, .overwrites = job.replaces});
  words.push_back("--plan=" + plan.string());
  return words;
}

void add_plan(const record::PlanRecord& plan, Job& job) {
  job.needs = needs_of(plan);
  job.files = {plan.inputs, plan.results, plan.relion_tomogram};
}

// The stacks of the series so far. A pattern may name a stack and the alignment or the metadata
// beside it, which would reconstruct it twice. Series with options of their own may share a stack.
class Stacks {
 public:
  void require_new(const std::string& stack, const Series& series, base::Faults& faults) {
    if (stack.empty() || !series.options.empty()) return;
    const auto [first, is_new] = sources_.emplace(stack, series.source);
    if (is_new) return;
    faults.add(fmt::format("{} and {} are of the same stack '{}': leave one of them out",
                           first->second, series.source, stack));
  }

 private:
  std::map<std::string, std::string> sources_;  // by stack
};

// Names finished tomograms of RELION that were made without its table, or whose rows are lost.
void warn_of_missing_rows(const std::vector<std::string>& names) {
  if (names.empty()) return;
  base::log_warning(
      fmt::format("the finished results of {} have no row for RELION beside them, so that the "
                  "tomograms.star of the batch leaves them out: --overwrite makes them again",
                  fmt::join(names, ", ")));
}

bool is_relion_table(const fs::path& file) {
  return io::lower_extension(file) == ".star" && io::lists_tomograms(file);
}

// Names tomograms of RELION that it could not use as its own, whose runs write no row.
void warn_of_unsuited(const std::vector<std::string>& names) {
  if (names.empty()) return;
  base::log_warning(fmt::format(
      "{} will have no row for RELION, and none in the tomograms.star of the batch, since "
      "the options give these tomograms another place than the project has (the log of "
      "each says which)",
      fmt::join(names, ", ")));
}

// Returns the outputs of a stopped batch with --overwrite that are still those of before it.
std::set<fs::path> outputs_to_replace(const PlanOptions& options) {
  std::set<fs::path> outputs;
  if (!options.skips_existing) return outputs;
  for (const Job& job : find_jobs(list_of(options.folder))) {
    const Progress progress = read_state(options.folder, job).progress;
    if (job.replaces && progress != Progress::kDone && progress != Progress::kSkipped)
      outputs.insert(fs::absolute(job.output).lexically_normal());
  }
  return outputs;
}

bool is_stopped(const PlanOptions& options) {
  return options.stop_requested && options.stop_requested();
}

// Makes jobs of series, and collects what is wrong with them.
class Planner {
 public:
  explicit Planner(const PlanOptions& options)
      : options_(options),
        scratch_(options.folder, ".tomofield-plan"),
        to_replace_(outputs_to_replace(options)) {}

  Job plan(const Series& series) {
    Job job{.name = series.name,
            .output = series.output,
            .command = command_of(series, options_.common),
            .needs = {},
            .files = {.inputs = {series.input}, .results = {}, .relion_tomogram = {}}};
    if (!is_free(series)) return job;
    job.replaces =
        options_.overwrites || to_replace_.contains(fs::absolute(job.output).lexically_normal());
    job.is_skipped = options_.skips_existing && !job.replaces && has_results(job.output);
    if (job.is_skipped)
      check_results(series, job);
    else
      rehearse(series, job);
    return job;
  }

  // Throws Error with all mistakes, also those of files that several jobs write or read.
  void require_no_faults(const std::vector<Job>& jobs) {
    check_files(options_.folder, options_.list, jobs, faults_);
    require_none(faults_);
    warn_of_missing_rows(without_row_);
    warn_of_unsuited(unsuited_);
  }

 private:
  // A run of a batch that was killed a moment ago may still end in order.
  bool is_free(const Series& series) {
    try {
      io::require_unlocked(series.output);
    } catch (const Error& error) {
      faults_.add(fmt::format("{}: {}", series.source, error.what()));
      return false;
    }
    return true;
  }

  void check_results(const Series& series, Job& job) {
    job.files.relion_tomogram = tomogram_of_result(job);
    if (series.is_tomogram && job.files.relion_tomogram.empty()) without_row_.push_back(job.name);
    if (const std::string fault = fault_of_results(job.output); !fault.empty())
      faults_.add(fmt::format("{}: {}: {}", series.source, fault, advice_on_files(job.output)));
  }

  void rehearse(const Series& series, Job& job) {
    const fs::path plan = scratch_.plan(), log = scratch_.log();
    fs::remove(plan);
    const base::ChildResult result =
        base::run_child(plan_command(options_, job, plan), log, options_.stop_requested);
    if (is_stopped(options_)) return;
    if (result.exit_status != 0) {
      const std::string said = base::reason_of_failure(result.exit_status, log);
      faults_.add(fmt::format("{}: {}", series.source,
                              job.replaces ? said : reason_in_batch(said, job.output)));
      return;
    }
    const record::PlanRecord planned = record::read_plan(plan);
    add_plan(planned, job);
    if (job.files.relion_tomogram.empty() && std::ranges::any_of(planned.inputs, is_relion_table))
      unsuited_.push_back(job.name);
    stacks_.require_new(planned.stack, series, faults_);
  }

  const PlanOptions& options_;
  const io::ScratchFolder scratch_;
  const std::set<fs::path> to_replace_;
  base::Faults faults_;
  Stacks stacks_;
  std::vector<std::string> without_row_, unsuited_;
};

}  // namespace

fs::path output_of(const Series& series, const fs::path& folder) {
  if (series.output.empty()) return folder / (series.name + ".mrc");
  return fill_placeholders(series.input, series.output.string(), series.source + ", output");
}

std::vector<std::string> command_of(const Series& series, const std::vector<GivenOption>& common) {
  std::vector<std::string> words{"reconstruct", base::file_word(series.input.string())};
  for (const GivenOption& option : common) {
    if (std::ranges::find(series.options, option.flag, &GivenOption::flag) ==
            series.options.end() &&
        std::ranges::find(series.left_out, option.flag) == series.left_out.end())
      words.push_back(option_for(series, option, option.flag).word());
  }
  for (const GivenOption& option : series.options)
    words.push_back(option_for(series, option, place_of(series, option)).word());
  words.push_back("--output=" + series.output.string());
  return words;
}

void check_placeholders(const std::vector<Series>& all, const std::vector<GivenOption>& common,
                        base::Faults& faults) {
  for (const GivenOption& option : common)
    faults.collect([&] { option_for({}, option, option.flag); });
  for (const Series& series : all)
    for (const GivenOption& option : series.options)
      faults.collect([&] { option_for(series, option, place_of(series, option)); });
}

void check_tomograms(const std::vector<Series>& all, const std::vector<GivenOption>& common,
                     base::Faults& faults) {
  const bool names_one = std::ranges::any_of(
      common, [](const GivenOption& option) { return option.flag == kSeriesOption; });
  const auto listed = std::ranges::find_if(all, &Series::is_tomogram);
  if (!names_one || listed == all.end()) return;
  faults.add(fmt::format(
      "the tomograms of '{}' are the series: leave {} out, or reconstruct the one that it names "
      "with `tomofield reconstruct`",
      listed->input.string(), kSeriesOption));
}

JobList plan_jobs(const std::vector<Series>& all, const PlanOptions& options) {
  Planner planner(options);
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  JobList list{.jobs = {},
               .overwrites = options.overwrites,
               .began_ns = std::chrono::nanoseconds(now).count()};
  for (const Series& series : all) {
    Job job = planner.plan(series);
    if (is_stopped(options)) return list;
    list.jobs.push_back(std::move(job));
  }
  join_rows(list.jobs);
  planner.require_no_faults(list.jobs);
  return list;
}

}  // namespace tomofield::batch
