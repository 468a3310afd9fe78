#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tune/trial_settings.h"
#include "tune/trials.h"

namespace tomofield::tune {

/// Adds score and time of a trial to its settings.
nlohmann::json trial_json(nlohmann::json settings, const HeldOutScore& score, double seconds);

/// Writes trials as JSON; settings_json(settings) writes the settings of one.
template <typename Settings, typename SettingsJson>
nlohmann::json trials_json(const std::vector<Trial<Settings>>& trials,
                           const SettingsJson& settings_json) {
  nlohmann::json table = nlohmann::json::array();
  for (const Trial<Settings>& t : trials)
    table.push_back(trial_json(settings_json(t.settings), t.score, t.seconds));
  return table;
}

/// Writes the chosen settings and all trials of a search.
template <typename Settings, typename SettingsJson>
nlohmann::json tuned_json(const Tuned<Settings>& tuned, const SettingsJson& settings_json) {
  return {{"predicted_views", tuned.predicted_views},
          {"chosen", settings_json(tuned.settings)},
          {"trials", trials_json(tuned.trials, settings_json)},
          {"last_trials", trials_json(tuned.last_trials, settings_json)}};
}

/// Writes settings in the form that trial files and metrics have.
nlohmann::json settings_json(const TrialSettings& settings);

/// Writes a trial. Reads one that somebody may have changed; throws Error or
/// nlohmann::json::exception if it is damaged.
nlohmann::json to_json(const FitTrial& trial);
FitTrial trial_from(const nlohmann::json& entry);

/// Returns a trial as text that trial_from_text() reads, for other processes of a job.
std::string text_of(const FitTrial& trial);
FitTrial trial_from_text(const std::string& text);

/// The finished trials of a search, and what they were made from.
struct StoredTrials {
  std::string fingerprint;
  std::vector<FitTrial> trials;
};
void write_trials(const std::filesystem::path& file, const StoredTrials& stored);
/// Throws Error with what is wrong, but not where.
StoredTrials read_trials(const std::filesystem::path& file);

/// Writes the chosen settings and all trials, each with its difference to the chosen one. Reads
/// them as trial_from() does.
nlohmann::json tuning_json(const TunedFit& tuned);
TunedFit tuned_from(const nlohmann::json& tuning);

/// Writes the trials of a run to a file, or null without trials (`reconstruct --choice FILE`).
void write_choice(const std::filesystem::path& file, const std::optional<TunedFit>& tuned);
/// Reads what write_choice() has written. Throws Error for anything else.
std::optional<TunedFit> read_choice(const std::filesystem::path& file);

}  // namespace tomofield::tune
