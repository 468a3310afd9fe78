#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tune/trials.h"

namespace tomofield::tune {

/// Adds score and time of a trial to its settings.
nlohmann::json trial_json(nlohmann::json settings, const HeldOutScore& score, double seconds);
/// Reads the score of a trial. Throws Error if it has none, or one that cannot be.
HeldOutScore score_from(const nlohmann::json& trial);

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

/// Keeps the finished trials of a search in a file (JSON), so that an interrupted run need not
/// repeat them.
class TrialFile {
 public:
  /// With `reuse`, reads the trials of an earlier run if the file exists. Throws Error if they
  /// belong to another `fingerprint` (series and options) or are damaged. With an empty path, it
  /// keeps the trials in memory alone.
  TrialFile(std::filesystem::path path, std::string fingerprint, bool reuse);

  /// Returns the trial that was made with these settings, if there is one.
  std::optional<nlohmann::json> find(const nlohmann::json& settings) const;
  /// Adds a trial (trial_json()) and rewrites the file.
  void add(nlohmann::json trial);

 private:
  std::filesystem::path path_;
  std::string fingerprint_;
  nlohmann::json trials_ = nlohmann::json::array();
};

}  // namespace tomofield::tune
