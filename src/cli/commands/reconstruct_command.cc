#include <filesystem>
#include <memory>
#include <optional>

#include "cli/commands/choice_file.h"
#include "cli/commands/commands.h"
#include "cli/commands/plan_file.h"
#include "cli/commands/run_reconstruction.h"
#include "cli/options/common_options.h"
#include "cli/options/help_formatter.h"
#include "cli/options/project_options.h"
#include "cli/options/table_options.h"
#include "cli/options/trace_option.h"
#include "options/run_options.h"
#include "output/output_paths.h"
#include "reconstruct/run_files.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

using option_table::Group;

struct ReconstructArguments {
  option_table::Choices choices;
  DryRun dry_run;
  std::optional<std::filesystem::path> trace, plan, choice;
  std::optional<std::filesystem::path> batch_choice;
};

// Gives the tomogram of a dry run without -o a name, of which nothing is written or checked.
// Returns whether there was a name.
bool settle_output(RunOptions& run, bool dry_run) {
  if (!run.output.empty()) return true;
  if (!dry_run)
    throw Error("--output is required: name the tomogram with -o (--dry-run needs none)");
  run.output = "tomogram.mrc";
  return false;
}

void run(const CLI::App& command, ReconstructArguments& arguments,
         const distributed::Communicator& processes) {
  processes.run_collectively([&] { open_project(command, arguments.choices); });
  const bool has_output = settle_output(arguments.choices.options.run, arguments.dry_run.is_wanted);
  if (arguments.batch_choice)
    note_choice_of_batch(command, *arguments.batch_choice, arguments.choices);
  options::ReconstructOptions options =
      options::run_options(arguments.choices.files, arguments.choices.options);
  options.has_output = has_output;
  processes.run_collectively([&] {
    check_extra_files({{arguments.plan, "--plan"},
                       {arguments.choice, "--choice"},
                       {arguments.trace, "--trace"},
                       {arguments.dry_run.grid, "--grid"}},
                      reconstruction::result_files(options), options.files, options.run);
  });
  if (arguments.plan) return write_plan(*arguments.plan, options, processes);
  run_traced(arguments.dry_run.is_wanted ? std::nullopt : arguments.trace, processes, [&] {
    if (arguments.choice && !arguments.dry_run.is_wanted)
      return write_choice(*arguments.choice, options, processes);
    run_reconstruction(options, arguments.dry_run, arguments.trace.has_value(), processes);
  });
}

}  // namespace

void add_reconstruct_command(CLI::App& program, const distributed::Communicator& processes) {
  CLI::App& command = *program.add_subcommand(
      "reconstruct", "Reconstruct a tomogram and a model from a tilt series");
  auto arguments = std::make_shared<ReconstructArguments>();
  add_input_options(command, arguments->choices);
  add_groups(command, arguments->choices,
             {Group::kTransfer, Group::kSpecimen, Group::kField, Group::kFit, Group::kVolume,
              Group::kHalves});
  add_run_options(command, arguments->choices, arguments->dry_run);
  CLI::Option* const output = command.get_option("--output")->required(false);
  output->description(output->get_description() + " (required without --dry-run)");
  add_common_options(command);
  add_trace_option(command, arguments->trace);
  add_plan_option(command, arguments->plan);
  add_choice_option(command, arguments->choice);
  add_batch_choice_option(command, arguments->batch_choice);
  add_groups(command, arguments->choices, {Group::kResearch});
  add_help_all(command);
  command.footer(
      "Example: tomofield reconstruct series.mrc --tlt series.tlt --xf series.xf --bin 4 \\\n"
      "           --thickness 1200 -o tomogram.mrc");
  command.callback([&command, arguments, &processes] { run(command, *arguments, processes); });
}

}  // namespace tomofield::cli
