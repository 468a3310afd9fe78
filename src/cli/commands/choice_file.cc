#include "cli/commands/choice_file.h"

#include "cli/options/help_formatter.h"
#include "cli/terminal/console.h"
#include "cli/terminal/exit_status.h"
#include "cli/terminal/progress_bar.h"
#include "cli/terminal/stop_signal.h"
#include "io/json.h"
#include "plan/plan.h"
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

void write_choice(const std::filesystem::path& file, const tilt_series::TiltSeries& series,
                  const options::ReconstructOptions& options,
                  const distributed::Communicator& processes) {
  processes.run_collectively([&] { plan::require_possible_run(series, options, processes); });
  stop_on_signals(processes.size() > 1);
  reconstruction::ReconstructHooks hooks{
      .progress = {}, .tune_progress = {}, .stop_requested = stop_was_requested};
  if (processes.is_root()) hooks.tune_progress = make_progress_bar("tune");
  const auto choice = reconstruction::choose_settings_alone(series, options, hooks, processes);
  if (!choice) throw ExitStatus{stop_status(), "stopped during the trials"};
  processes.run_collectively([&] {
    if (processes.is_root()) io::write_json(file, *choice);
  });
  if (processes.is_root()) print("choice    {}\n", file.string());
}

}  // namespace tomofield::cli
