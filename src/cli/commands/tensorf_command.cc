#include "cli/commands/tensorf_command.h"

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "baseline/neural/tensorf.h"
#include "cli/commands/run_reconstruction.h"
#include "cli/options/common_options.h"
#include "cli/options/fit_options.h"
#include "cli/options/help_formatter.h"
#include "cli/options/table_options.h"
#include "cli/options/trace_option.h"
#include "options/run_options.h"
#include "output/output_paths.h"

namespace tomofield::cli {
namespace {

struct TensorfArguments {
  option_table::Choices choices{{}, baseline::tensorf_defaults()};
  std::optional<bool> non_negative;
  bool dry_run = false;
  std::optional<std::filesystem::path> trace;
};

void add_method_options(CLI::App& command, TensorfArguments& arguments) {
  const char* group = "Method";
  for (const char* key : {"field.rank", "fit.epochs", "fit.coarse_epochs", "fit.density_variation",
                          "fit.fourier", "fit.learning_rate", "fit.seed"})
    add_row(command, key, arguments.choices, group);
  add_non_negative(command, arguments.non_negative);
}

void run(TensorfArguments& arguments, const std::vector<option_table::Setting>& origins) {
  Options& requested = arguments.choices.options;
  if (arguments.non_negative)
    requested.activation = *arguments.non_negative ? Activation::kSoftplus : Activation::kIdentity;
  options::ReconstructOptions options = options::run_options(arguments.choices.files, requested);
  options.origins = origins;
  options.field.depth = 0;  // the tree is one node
  const std::vector<io::OutputLock> locks = claim_run(options, arguments.dry_run);
  const output::OutputPaths paths = output::output_paths(options.resolved.output);
  check_trace_file(arguments.trace, {paths.volume, paths.model, paths.json}, options.files,
                   options.resolved.overwrite);
  options.input.keep_views = !arguments.dry_run;
  const auto& alone = distributed::Communicator::alone();
  run_traced(arguments.dry_run ? std::nullopt : arguments.trace, alone, [&] {
    const tilt_series::TiltSeries series(options.input);
    options.field.leaf_size = baseline::one_node_size(
        plan_measurement(series, options.specimen).roi, options.fit.coarse_bin);
    options.resolved.leaf_size = options.field.leaf_size;
    run_reconstruction(series, options, arguments.dry_run);
  });
}

}  // namespace

void add_tensorf(CLI::App& baseline, const std::vector<option_table::Setting>& origins) {
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
  command.callback([arguments, &origins] { run(*arguments, origins); });
}

}  // namespace tomofield::cli
