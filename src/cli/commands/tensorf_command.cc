#include "cli/commands/tensorf_command.h"

#include <filesystem>
#include <memory>
#include <optional>

#include "base/check.h"
#include "baseline/neural/tensorf.h"
#include "cli/commands/run_reconstruction.h"
#include "cli/options/common_options.h"
#include "cli/options/fit_options.h"
#include "cli/options/help_formatter.h"
#include "cli/options/project_options.h"
#include "cli/options/table_options.h"
#include "cli/options/trace_option.h"
#include "options/run_options.h"
#include "output/output_paths.h"

namespace tomofield::cli {
namespace {

struct TensorfArguments {
  option_table::Choices choices{{}, baseline::tensorf_defaults()};
  std::optional<bool> non_negative;
  DryRun dry_run;
  std::optional<std::filesystem::path> trace;
};

void add_method_options(CLI::App& command, TensorfArguments& arguments) {
  const char* group = "Method";
  for (const char* key : {"field.rank", "fit.epochs", "fit.coarse_epochs", "fit.density_variation",
                          "fit.fourier", "fit.learning_rate", "fit.seed"})
    add_row(command, key, arguments.choices, group);
  add_non_negative(command, arguments.non_negative);
}

// Returns the side of the one node, which the headers of the series decide.
int size_of_node(const options::ReconstructOptions& options) {
  return baseline::one_node_size(tilt_series::PlannedSeries(options.input()), options);
}

void run(const CLI::App& command, TensorfArguments& arguments) {
  open_project(command, arguments.choices);
  Options& requested = arguments.choices.options;
  if (arguments.non_negative)
    requested.field.activation =
        *arguments.non_negative ? Activation::kSoftplus : Activation::kIdentity;
  options::ReconstructOptions options = options::run_options(arguments.choices.files, requested);
  const output::OutputPaths paths = output::output_paths(options.run.output);
  check_extra_files({{arguments.trace, "--trace"}, {arguments.dry_run.grid, "--grid"}},
                    {paths.volume, paths.model, paths.json}, options.files, options.run);
  base::require_no_faults(options.faults());
  options.field.leaf_size = size_of_node(options);
  run_traced(arguments.dry_run.is_wanted ? std::nullopt : arguments.trace,
             distributed::Communicator::alone(),
             [&] { run_reconstruction(options, arguments.dry_run, arguments.trace.has_value()); });
}

}  // namespace

void add_tensorf(CLI::App& baseline) {
  CLI::App& command = *baseline.add_subcommand(
      "tensorf", "One factorised tensor for the whole region, coarse to fine, as in TensoRF");
  const auto arguments = std::make_shared<TensorfArguments>();
  add_input_options(command, arguments->choices);
  add_groups(command, arguments->choices,
             {option_table::Group::kTransfer, option_table::Group::kSpecimen});
  add_method_options(command, *arguments);
  add_shared_fit_options(command, arguments->choices);
  add_groups(command, arguments->choices, {option_table::Group::kVolume});
  add_run_options(command, arguments->choices, arguments->dry_run);
  add_common_options(command);
  add_trace_option(command, arguments->trace);
  add_help_all(command);
  command.callback([&command, arguments] { run(command, *arguments); });
}

}  // namespace tomofield::cli
