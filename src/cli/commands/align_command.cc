#include <filesystem>
#include <memory>

#include "cli/commands/commands.h"
#include "cli/commands/run_reconstruction.h"
#include "cli/options/common_options.h"
#include "cli/options/help_formatter.h"
#include "cli/options/project_options.h"
#include "cli/options/table_options.h"
#include "cli/terminal/console.h"
#include "option_table/rows.h"
#include "options/run_options.h"
#include "reconstruct/reconstruct.h"

namespace tomofield::cli {
namespace {

using option_table::Group;

void run(const CLI::App& command, option_table::Choices& choices) {
  open_project(command, choices);
  options::ReconstructOptions options = options::run_options(choices.files, choices.options);
  stop_on_signals(false);
  const auto& alone = distributed::Communicator::alone();
  if (!reconstruction::align(options, terminal_observer(alone))) throw_stopped_alignment();
  print_alignment(options);
}

}  // namespace

void add_align_command(CLI::App& program) {
  CLI::App& command = *program.add_subcommand(
      "align", "Align the views of a tilt series with each other, without a reconstruction");
  auto choices = std::make_shared<option_table::Choices>();
  add_input_options(command, *choices);
  add_groups(command, *choices, {Group::kSpecimen});
  choices->options.run.align = Alignment::kRefine;
  for (const char* key : {"fit.align", "fit.seed", "running.output", "running.overwrite"})
    add_row(command, key, *choices);
  command.get_option("--output")
      ->description(
          "The alignment's files are called after it, and it is not written itself: "
          "NAME_align.xf for NAME.mrc");
  command.get_option("--align")
      ->description(
          "refine: begin with the alignment of the files; full: begin with views as they were "
          "recorded")
      ->type_name("refine|full");
  add_common_options(command);
  add_help_all(command);
  command.footer(
      "Example: tomofield align series.mrc --tlt series.tlt --align full --thickness 1200 \\\n"
      "           -o series.mrc\nThe files are called after the output: series_align.xf, .tlt, "
      ".aln, .json and .png");
  command.callback([&command, choices] { run(command, *choices); });
}

}  // namespace tomofield::cli
