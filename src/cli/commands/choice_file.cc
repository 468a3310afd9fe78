#include "cli/commands/choice_file.h"

#include <algorithm>
#include <string>
#include <vector>

#include "batch/choice.h"
#include "cli/commands/run_reconstruction.h"
#include "cli/options/common_options.h"
#include "cli/options/help_formatter.h"
#include "cli/terminal/console.h"
#include "io/saving/output_files.h"
#include "option_table/setting.h"
#include "reconstruct/reconstruct.h"

namespace tomofield::cli {

void add_choice_option(CLI::App& command, std::optional<std::filesystem::path>& file) {
  command
      .add_option("--choice", file,
                  "Make the trials that choose settings, write what they choose, and do not fit")
      ->type_name("FILE.json")
      ->excludes("--plan")
      ->group(kHelpAllGroup);
}

void add_batch_choice_option(CLI::App& command, std::optional<std::filesystem::path>& file) {
  command
      .add_option("--batch-choice", file,
                  "The choice of a batch, which --tv-penalty, --tv, --spike-rank and --prior come "
                  "from: the report says so")
      ->type_name("FILE.json")
      ->group(kHelpAllGroup);
}

void note_choice_of_batch(const CLI::App& command, const std::filesystem::path& file,
                          option_table::Choices& choices) {
  io::add_input(file);
  std::vector<Setting> settings;
  for (const option_table::GivenOption& given : given_options(command, {})) {
    if (!given.value || !batch::is_shared(given.flag)) continue;
    settings.push_back({.option = given.flag,
                        .value = *given.value,
                        .file = file,
                        .entry = "choice for all series of the batch"});
  }
  option_table::note_settings(settings, choices);
}

void write_choice(const std::filesystem::path& file, const options::ReconstructOptions& options,
                  const distributed::Communicator& processes) {
  stop_on_signals(processes.size() > 1);
  if (!reconstruction::choose(file, options, terminal_observer(processes), processes))
    throw ExitStatus{stop_status(), "stopped during the trials"};
  if (processes.is_root()) print("choice    {}\n", file.string());
}

}  // namespace tomofield::cli
