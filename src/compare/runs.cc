#include "compare/runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <optional>
#include <string>
#include <system_error>

#include "base/system/child_process.h"
#include "compare/folder.h"
#include "compare/grid.h"
#include "evaluate/box.h"
#include "io/is_file.h"
#include "io/saving/output_files.h"
#include "io/saving/output_folder.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

namespace fs = std::filesystem;

const char* suffix_of(Purpose purpose) {
  switch (purpose) {
    case Purpose::kVolume:
      return "";
    case Purpose::kOddViews:
      return ".odd";
    case Purpose::kEvenViews:
      return ".even";
    case Purpose::kHeldOutViews:
      return ".held_out";
  }
  return "";
}

// Returns the 1-based sections that are left out: the user's, and every second one of the rest.
std::string excluded(Purpose purpose, const CompareOptions& options,
                     const tilt_series::PlannedSeries& series) {
  std::string sections = options.series.views.exclude;
  if (purpose != Purpose::kOddViews && purpose != Purpose::kEvenViews) return sections;
  const std::size_t first = purpose == Purpose::kOddViews ? 1 : 0;
  for (std::size_t v = first; v < series.views().size(); v += 2)
    sections += fmt::format("{}{}", sections.empty() ? "" : ",", series.views()[v].section + 1);
  return sections;
}

// Returns the number of words that name the command, such as "baseline tv". Its options follow.
std::ptrdiff_t num_command_words(const Method& method) {
  const auto option = std::ranges::find_if(
      method.arguments, [](const std::string& word) { return word.starts_with('-'); });
  return option - method.arguments.begin();
}

// Returns the files among a method's own words: `--mask FILE`, `--config=FILE`.
std::vector<fs::path> named_files(const std::vector<std::string>& words) {
  std::vector<fs::path> files;
  for (const std::string& word : words) {
    const fs::path value = word.starts_with('-') ? word.substr(word.find('=') + 1) : word;
    if (io::is_file(value)) files.push_back(value);
  }
  return files;
}

Run plan_run(Purpose purpose, const Method& method, const std::string& exclude,
             const CompareOptions& options) {
  Run run{.name = method.name + suffix_of(purpose), .method = method, .command = {}, .inputs = {}};
  // The series comes before the method's own options, because the last of these may take several
  // values.
  const auto own = method.arguments.begin() + num_command_words(method);
  run.command.assign(method.arguments.begin(), own);
  std::ranges::copy(options.series_words, std::back_inserter(run.command));
  std::copy(own, method.arguments.end(), std::back_inserter(run.command));
  if (!exclude.empty()) run.command.insert(run.command.end(), {"--exclude", exclude});
  if (purpose == Purpose::kHeldOutViews)
    run.command.insert(run.command.end(), {"--hold-out", std::to_string(options.hold_out)});
  // Settings are tuned again for every purpose: those chosen on all views have seen the held-out
  // ones.
  if (options.tune && method.tunes) run.command.push_back("--tune");
  run.inputs = io::input_files(options.files);
  std::ranges::copy(named_files({own, method.arguments.end()}), std::back_inserter(run.inputs));
  std::ranges::copy(named_files(method.expanded), std::back_inserter(run.inputs));
  return run;
}

// Returns the row's future volume, or nothing if it was asked to stop.
std::optional<record::PlannedVolume> volume_to_be(const CompareOptions& options,
                                                  const RunHooks& hooks, const Row& row,
                                                  const io::ScratchFolder& scratch) {
  if (is_done(row)) return record::PlannedVolume{read_grid(row.volume)};
  const fs::path log = scratch.log(), grid = scratch.plan();
  std::error_code absent;
  fs::remove(grid, absent);  // that of the row before
  auto command = full_command(options.program, row, row.volume);
  command.insert(command.end(), {"--dry-run", "--grid", grid.string()});
  const base::ChildResult result = base::run_child(command, log, hooks.stop_requested);
  if (hooks.must_stop()) return std::nullopt;
  if (result.exit_status != 0)
    throw Error(
        fmt::format("{}: {}", row.run.name, base::reason_of_failure(result.exit_status, log)));
  if (!io::is_file(grid))
    throw Error(fmt::format("{}: its dry run has written no plan", row.run.name));
  return record::read_planned_volume(grid);
}

// Throws Error unless the regions and the profile that are given lie in the volumes.
void require_places_within(const CompareOptions& options, const Grid& grid) {
  const base::Box all{.begin = {0, 0, 0}, .end = grid.size};
  for (const auto* boxes : {&options.regions.foreground, &options.regions.background}) {
    for (const base::Box& box : *boxes) {
      if (evaluate::lies_within(box, all)) continue;
      throw Error(
          fmt::format("the region {} does not lie in the volumes' voxels {}: give "
                      "--foreground and --background inside",
                      evaluate::to_text(box), evaluate::to_text(all)));
    }
  }
  if (options.profile) evaluate::require_line_within(*options.profile, all);
}

}  // namespace

PlannedRuns plan_runs(const CompareOptions& options, const tilt_series::PlannedSeries& series) {
  PlannedRuns plan{{Purpose::kVolume}, {}};
  if (options.halves)
    plan.purposes.insert(plan.purposes.end(), {Purpose::kOddViews, Purpose::kEvenViews});
  if (options.hold_out > 0) plan.purposes.push_back(Purpose::kHeldOutViews);
  for (const Purpose purpose : plan.purposes) {
    const std::string exclude = excluded(purpose, options, series);
    for (const Method& method : options.methods)
      plan.runs.push_back(plan_run(purpose, method, exclude, options));
  }
  return plan;
}

bool rehearse(const CompareOptions& options, const RunHooks& hooks, const std::vector<Row>& rows) {
  const io::ScratchFolder scratch(options.folder, ".tomofield-rehearsal");
  std::optional<NamedGrid> main;
  std::vector<fs::path> files;
  for (const Row& row : rows) {
    const auto planned = volume_to_be(options, hooks, row, scratch);
    if (!planned) return false;
    check_planned_files(options, rows, row, planned->files);
    std::vector<fs::path> of_row = files_of(row);
    of_row.insert(of_row.end(), planned->files.begin(), planned->files.end());
    std::ranges::sort(of_row);
    of_row.erase(std::unique(of_row.begin(), of_row.end()), of_row.end());
    files.insert(files.end(), of_row.begin(), of_row.end());
    if (!main) {
      main = {row.run.name, planned->grid};
      const bool is_a_part =
          std::ranges::find(options.series_words, "--roi") != options.series_words.end();
      if (options.truth) require_truth_fits(*options.truth, *main, is_a_part);
      require_places_within(options, planned->grid);
    }
    require_one_grid(*main, {row.run.name, planned->grid});
  }
  io::require_distinct(files);
  return true;
}

}  // namespace tomofield::compare
