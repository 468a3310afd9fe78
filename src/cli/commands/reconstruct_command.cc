#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "cli/commands/choice_file.h"
#include "cli/commands/commands.h"
#include "cli/commands/plan_file.h"
#include "cli/commands/run_reconstruction.h"
#include "cli/options/common_options.h"
#include "cli/options/help_formatter.h"
#include "cli/options/table_options.h"
#include "cli/options/trace_option.h"
#include "options/run_options.h"
#include "output/output_paths.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

using option_table::Group;

struct ReconstructArguments {
  option_table::Choices choices;
  bool dry_run = false;
  std::optional<std::filesystem::path> trace, plan, choice;
};

// Returns the options, with a name for the tomogram that a dry run needs and does not write.
Options with_output(Options options, bool dry_run) {
  if (!options.output.empty()) return options;
  if (!dry_run)
    throw Error("--output is required: name the tomogram with -o (--dry-run needs none)");
  options.output = "tomofield_dry_run.mrc";
  options.overwrite = true;
  return options;
}

void run(const ReconstructArguments& arguments, const distributed::Communicator& processes,
         const std::vector<option_table::Setting>& origins) {
  options::ReconstructOptions options = options::run_options(
      arguments.choices.files, with_output(arguments.choices.options, arguments.dry_run));
  options.origins = origins;
  std::vector<io::OutputLock> locks;
  processes.run_collectively([&] {
    locks = claim_run(options, arguments.dry_run || arguments.plan || !processes.is_root());
    check_answer_file(arguments.plan, "--plan", options);
    check_answer_file(arguments.choice, "--choice", options);
    const output::OutputPaths paths = output::output_paths(options.resolved.output);
    check_trace_file(arguments.trace, {paths.volume, paths.model, paths.json}, options.files,
                     options.resolved.overwrite);
  });
  if (arguments.plan) {
    options.input.look_at_views = false;
    return write_plan(*arguments.plan, tilt_series::TiltSeries(options.input, processes), options,
                      processes);
  }
  options.input.keep_views = !arguments.dry_run;
  run_traced(arguments.dry_run ? std::nullopt : arguments.trace, processes, [&] {
    const tilt_series::TiltSeries series = open_series(options, arguments.dry_run, processes);
    if (arguments.choice && !arguments.dry_run)
      return write_choice(*arguments.choice, series, options, processes);
    run_reconstruction(series, options, arguments.dry_run, processes);
  });
}

}  // namespace

void add_reconstruct_command(CLI::App& program, const distributed::Communicator& processes,
                             const std::vector<option_table::Setting>& origins) {
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
  add_help_all(command);
  command.footer(
      "Example: tomofield reconstruct series.mrc --tlt series.tlt --xf series.xf --bin 4 \\\n"
      "           --thickness 1200 -o tomogram.mrc");
  command.callback([arguments, &processes, &origins] { run(*arguments, processes, origins); });
}

}  // namespace tomofield::cli
