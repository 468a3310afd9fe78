#include "cli/commands/choice_file.h"

#include "cli/commands/run_reconstruction.h"
#include "cli/options/help_formatter.h"
#include "cli/terminal/console.h"
#include "io/json.h"
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

void write_choice(const std::filesystem::path& file, const options::ReconstructOptions& options,
                  const distributed::Communicator& processes) {
  stop_on_signals(processes.size() > 1);
  const auto choice = reconstruction::choose(options, terminal_observer(processes), processes);
  if (!choice) throw ExitStatus{stop_status(), "stopped during the trials"};
  processes.run_collectively([&] {
    if (processes.is_root()) io::write_json(file, *choice);
  });
  if (processes.is_root()) print("choice    {}\n", file.string());
}

}  // namespace tomofield::cli
