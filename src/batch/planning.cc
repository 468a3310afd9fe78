#include "batch/planning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "base/system/child_process.h"
#include "batch/file_conflicts.h"
#include "batch/series_list.h"
#include "io/saving/output_folder.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;
using option_table::GivenOption;

// Says whether a text in braces is written like the name of a placeholder.
bool is_word(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](unsigned char c) {
    return std::isalpha(c) != 0 || c == '_';
  });
}

// Returns a text with the names of a series in place of {name} and {folder}. Throws Error, with
// what `where` says of the text, for another word in braces.
std::string filled(const Series& series, const std::string& text, const std::string& where) {
  const fs::path folder = series.input.parent_path();
  std::string result;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text[at] == '{' ? text.find('}', at) : std::string::npos;
    const std::string word = end == std::string::npos ? "" : text.substr(at + 1, end - at - 1);
    if (word == "name") {
      result += series_name(series.input);
    } else if (word == "folder") {
      result += folder.empty() ? "." : folder.string();
    } else if (is_word(word)) {
      throw Error(
          fmt::format("{}: '{{{}}}' stands for nothing: {{name}} stands for the name of a "
                      "series' file without its ending, {{folder}} for its folder",
                      where, word));
    } else {
      result += text[at++];
      continue;
    }
    at = end + 1;
  }
  return result;
}

GivenOption option_for(const Series& series, GivenOption option, const std::string& where) {
  if (option.value) option.value = filled(series, *option.value, where);
  return option;
}

// Throws Error with every word in braces that stands for nothing in an option.
void require_placeholders(const std::vector<Series>& all, const std::vector<GivenOption>& common) {
  for (const GivenOption& option : common) option_for({}, option, option.flag);
  Faults faults;
  for (const Series& series : all) {
    try {
      command_of(series, {});
    } catch (const Error& error) {
      faults.add(error.what());
    }
  }
  faults.require_none();
}

// Returns the words that check a job and write what it needs to `plan`.
std::vector<std::string> plan_command(const PlanOptions& options, const Job& job,
                                      const fs::path& plan) {
  std::vector<std::string> words =
      command_of(options.program, job, options.threads,
                 {.resumes = options.skips_existing, .overwrites = options.overwrites});
  words.push_back("--plan=" + plan.string());
  return words;
}

void add_plan(const record::PlanRecord& plan, Job& job) {
  job.needs = needs_of(plan);
  job.files = {plan.inputs, plan.results};
}

// The stacks of the series so far. A pattern may name a stack and the alignment or the metadata
// beside it, which would reconstruct it twice. Series with options of their own may share a stack.
class Stacks {
 public:
  void require_new(const std::string& stack, const Series& series, Faults& faults) {
    if (stack.empty() || !series.options.empty()) return;
    const auto [first, is_new] = sources_.emplace(stack, series.source);
    if (is_new) return;
    faults.add(fmt::format("{} and {} are of the same stack '{}': leave one of them out",
                           first->second, series.source, stack));
  }

 private:
  std::map<std::string, std::string> sources_;  // by stack
};

}  // namespace

fs::path output_of(const Series& series, const fs::path& folder) {
  if (series.output.empty()) return folder / (series.name + ".mrc");
  return filled(series, series.output.string(), series.source + ", output");
}

std::vector<std::string> command_of(const Series& series, const std::vector<GivenOption>& common) {
  // A file called "-x.mrc" would be an option.
  const bool looks_like_option = series.input.string().starts_with('-');
  std::vector<std::string> words{"reconstruct",
                                 (looks_like_option ? "." / series.input : series.input).string()};
  for (const GivenOption& option : common) {
    if (std::ranges::find(series.options, option.flag, &GivenOption::flag) == series.options.end())
      words.push_back(option_for(series, option, option.flag).word());
  }
  for (const GivenOption& option : series.options)
    words.push_back(option_for(series, option, series.source + ", " + option.flag).word());
  words.push_back("--output=" + series.output.string());
  return words;
}

JobList plan_jobs(const std::vector<Series>& all, const PlanOptions& options) {
  require_placeholders(all, options.common);
  const io::ScratchFolder scratch(options.folder, ".tomofield-plan");
  const fs::path plan = scratch.path() / "plan.json", log = scratch.path() / "log";
  Faults faults;
  Stacks stacks;
  JobList list{.jobs = {}, .overwrites = options.overwrites};
  for (const Series& series : all) {
    Job job{.name = series.name,
            .output = series.output,
            .command = command_of(series, options.common),
            .needs = {},
            .is_skipped = options.skips_existing && has_results(series.output),
            .files = {.inputs = {series.input}, .results = {}}};
    if (!job.is_skipped) {
      fs::remove(plan);
      const base::ChildResult result =
          base::run_child(plan_command(options, job, plan), log, options.stop_requested);
      if (options.stop_requested && options.stop_requested()) return list;
      if (result.exit_status != 0)
        faults.add(
            fmt::format("{}: {}", series.source, base::reason_of_failure(result.exit_status, log)));
      else {
        const record::PlanRecord planned = record::read_plan(plan);
        add_plan(planned, job);
        stacks.require_new(planned.stack, series, faults);
      }
    }
    list.jobs.push_back(std::move(job));
  }
  faults.require_none();
  require_own_files(options.folder, options.list, list.jobs);
  return list;
}

}  // namespace tomofield::batch
