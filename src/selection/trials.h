#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "fit/fit.h"
#include "selection/search.h"

namespace tomofield::selection {

/// Trials of a tuning that are done, kept in a file (JSON) so that a run that was
/// interrupted need not repeat them.
class TrialFile {
 public:
  /// With `reuse`, reads the trials of an earlier run, if there are any. Throws
  /// Error if they are of another `fingerprint` (series and options) or damaged.
  TrialFile(std::filesystem::path path, std::string fingerprint, bool reuse);

  std::optional<Trial> find(const TrialSettings& settings) const;
  /// Adds a trial and writes the file anew.
  void add(const Trial& trial);

 private:
  std::filesystem::path path_;
  std::string fingerprint_;
  std::vector<Trial> trials_;
};

/// Rows of a trial, in the middle: enough for edges in every direction, few enough for a dozen
/// fits.
constexpr std::int64_t kTrialRows = 64;

struct TuneHooks {
  base::ProgressSink progress;
  std::function<bool()> stop_requested;  ///< asked after every step
};

struct Tuned {
  TrialSettings settings;
  std::vector<Trial> trials;
  std::vector<int> predicted_views;  ///< by which they were chosen
};

/// What a tuning chose, and everything that it tried; tuned_from() reads it, with or without the
/// seconds of the trials.
nlohmann::json tuning_json(const Tuned& tuned);
Tuned tuned_from(const nlohmann::json& tuning);

/// Chooses settings by search_settings(), the penalty too if `tunes_penalty`. Trials are made on
/// a strip of rows in the middle and without the views that `measurement` holds out to score the
/// result (trial_series.h). Finished trials go to `file`, and those found there are not
/// repeated. None if a stop was requested. Throws Error for too few views.
std::optional<Tuned> tune(const measurement::Measurement& measurement,
                          const fit::FieldOptions& field, const fit::FitOptions& fit,
                          bool tunes_penalty, TrialFile& file, const TuneHooks& hooks);

/// Chooses the penalty alone, by choose_penalty(): two trials on half as many rows, of plain
/// vertices whatever the field, since which penalty is right is the specimen's affair and they
/// converge in a fraction of the time: a few per cent of a fit of 256 rows. None if a stop was
/// requested.
std::optional<Tuned> tune_penalty(const measurement::Measurement& measurement,
                                  const fit::FieldOptions& field, const fit::FitOptions& fit,
                                  const TuneHooks& hooks);

}  // namespace tomofield::selection
