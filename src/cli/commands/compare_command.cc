#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/log.h"
#include "base/system/child_process.h"
#include "cli/commands/commands.h"
#include "cli/options/common_options.h"
#include "cli/options/config_file.h"
#include "cli/options/help_formatter.h"
#include "cli/options/number_checks.h"
#include "cli/options/place_options.h"
#include "cli/options/project_options.h"
#include "cli/options/table_options.h"
#include "cli/terminal/console.h"
#include "compare/comparison.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

constexpr double kMaxViews = 1e9;

struct CompareArguments {
  option_table::Choices choices;  // checked here, used by the methods
  std::vector<std::string> names{"grid", "tv", "sirt", "wbp"};
  std::vector<std::string> others;
  std::string truth, folder;
  bool tune = false, halves = false, overwrite = false;
  int hold_out = 0;
  evaluate::Regions regions;
  std::optional<evaluate::LineSegment> profile;
};

// Returns the words that describe the series, as they were given. Every method gets them.
std::vector<std::string> series_words(const CLI::App& command,
                                      const std::vector<std::string>& own_options) {
  std::vector<std::string> words;
  for (const option_table::GivenOption& given : given_options(command, own_options)) {
    // A separate value that begins with a minus would count as an option.
    const bool is_one_word = given.flag.empty() || !given.value || given.value->starts_with('-');
    if (is_one_word) {
      words.push_back(given.word());
    } else {
      words.push_back(given.flag);
      words.push_back(*given.value);
    }
  }
  return words;
}

// Refuses an option by which a run writes other files than those of the comparison, or none.
void require_results_alone(const compare::Method& method) {
  constexpr std::array<std::string_view, 5> kOthers{"--trace", "--plan", "--choice", "--grid",
                                                    "--dry-run"};
  for (const std::string& word : method.expanded) {
    const auto flag = std::string_view(word).substr(0, word.find('='));
    if (std::ranges::find(kOthers, flag) != kOthers.end())
      throw Error(fmt::format("{}: {} is not for a comparison: run `tomofield {}` by itself",
                              method.name, flag, fmt::join(method.arguments, " ")));
  }
}

// Reads the configuration files of methods, for the files that these name.
void expand_methods(const CLI::App& program, std::vector<compare::Method>& methods) {
  for (compare::Method& method : methods) {
    method.expanded = method.arguments;
    try {
      expand_config_file(program, method.expanded);
    } catch (const Error& error) {
      throw Error(fmt::format("{}: {}", method.name, error.what()));
    }
    require_results_alone(method);
  }
}

ExitStatus stopped(compare::Outcome outcome, const CompareArguments& arguments) {
  if (outcome == compare::Outcome::kStoppedBeforeRuns)
    return {stop_status(), "stopped before the first run; nothing has been made or removed"};
  return {stop_status(),
          fmt::format("stopped; finished runs are in '{}': continue with the same command{}",
                      arguments.folder, arguments.overwrite ? " without --overwrite" : "")};
}

void run(const CLI::App& command, CompareArguments& arguments,
         const std::vector<std::string>& own_options) {
  open_project(command, arguments.choices);  // each method opens it, too
  compare::CompareOptions options;
  options.program = base::program_path();
  options.files = arguments.choices.files;
  options.series = arguments.choices.options;
  options.series_words = series_words(command, own_options);
  options.methods = compare::choose_methods(arguments.names, arguments.others);
  expand_methods(*command.get_parent(), options.methods);
  if (!arguments.truth.empty()) options.truth = arguments.truth;
  options.tune = arguments.tune;
  options.halves = arguments.halves;
  options.hold_out = arguments.hold_out;
  options.regions = arguments.regions;
  options.profile = arguments.profile;
  options.folder = arguments.folder;
  options.overwrite = arguments.overwrite;
  compare::check_comparison(options);
  stop_on_signals();
  const compare::RunHooks hooks{
      .run_starts =
          [](const compare::Run& run, bool is_there) {
            base::log_info(
                fmt::format("{}: {}", run.name,
                            is_there ? "already done" : "running; its log is beside the volume"));
          },
      .stop_requested = stop_was_requested};
  const compare::Outcome outcome = compare::compare_methods(options, hooks);
  if (outcome != compare::Outcome::kFinished) throw stopped(outcome, arguments);
  print("report    {}\nmetrics   {}\ntable     {}\n", (options.folder / "report.html").string(),
        (options.folder / "comparison.json").string(),
        (options.folder / "comparison.csv").string());
}

std::vector<std::string> add_own_options(CLI::App& command, CompareArguments& arguments) {
  const char* group = "Comparison";
  command
      .add_option("--methods", arguments.names,
                  fmt::format("Methods to run, the main one first: some of {}",
                              fmt::join(compare::names_of(compare::known_methods()), ", ")))
      ->delimiter(',')
      ->default_str(fmt::format("{}", fmt::join(arguments.names, ",")))
      ->type_name("NAME,…")
      ->group(group);
  command
      .add_option("--also", arguments.others,
                  "A method of your own, as in 'smooth=reconstruct --tv-penalty smooth'; may be "
                  "repeated")
      ->type_name("NAME=COMMAND")
      ->allow_extra_args(false)
      ->group(group);
  command.add_option("--truth", arguments.truth, "MRC volume to score all methods against")
      ->type_name("FILE")
      ->group(group);
  command
      .add_flag("--tune", arguments.tune,
                "Tune every method that has --tune, separately in each run. Runs for --hold-out "
                "are tuned "
                "without the views that score them")
      ->group(group);
  command
      .add_flag(
          "--halves", arguments.halves,
          "Also run every method on the odd and on the even views, and correlate the two volumes")
      ->group(group);
  command
      .add_option("--hold-out", arguments.hold_out,
                  "Also run every method without every Nth view, and report how well it predicts "
                  "these views")
      ->check(number_between(2, kMaxViews))
      ->group(group);
  add_region_options(command, "the volumes", group, arguments.regions);
  add_profile_option(command,
                     "Line whose densities the report draws, in voxels, as across a membrane "
                     "(default: along X through the detail); profile.csv has the numbers",
                     group, arguments.profile);
  command.add_option("-o,--output", arguments.folder, "Folder of all results")
      ->required()
      ->type_name("FOLDER")
      ->group(group);
  command
      .add_flag("--overwrite", arguments.overwrite, "Remove old results and run all methods again")
      ->group(group);
  return {"--methods",    "--also",       "--truth",   "--tune",   "--halves",    "--hold-out",
          "--foreground", "--background", "--profile", "--output", "--overwrite", "--exclude"};
}

}  // namespace

void add_compare_command(CLI::App& program) {
  CLI::App& command = *program.add_subcommand(
      "compare",
      "Run several methods on one series, and write their volumes, a table and report.html");
  auto arguments = std::make_shared<CompareArguments>();
  add_input_options(command, arguments->choices);
  add_groups(command, arguments->choices,
             {option_table::Group::kTransfer, option_table::Group::kSpecimen});
  add_row(command, "fit.fit_view_scale", arguments->choices);
  const auto own_options = add_own_options(command, *arguments);
  add_common_options(command);
  add_help_all(command);
  command.callback([&command, arguments, own_options] { run(command, *arguments, own_options); });
}

}  // namespace tomofield::cli
