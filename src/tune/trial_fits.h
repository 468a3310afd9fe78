#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "tune/trial_measurement.h"
#include "tune/tuning.h"

namespace tomofield::tune {

/// Makes the trials of a search, with its progress. The trials of a batch take their steps side by
/// side. Several processes share the trials of a batch: each makes some of them alone.
class TrialFits {
 public:
  /// The trials use at most `rows` rows in the middle of `measurement`. With
  /// `scores_with_view_scale`, predicted views are scored with a scale and an offset each, so that
  /// trials with and without scales compare. All references must outlive the object.
  TrialFits(const measurement::Measurement& measurement, std::int64_t rows,
            const FieldOptions& field, const FitOptions& fit, bool scores_with_view_scale,
            const TuneHooks& hooks, int num_expected, const distributed::Communicator& processes);

  /// Makes a trial with each of these settings. Takes those that `file` has from it, and adds the
  /// others to it; the root alone uses it, and it may be null. After every step it calls the hooks,
  /// in the calling thread. Throws base::StopRequested if a stop was requested; `file` then has the
  /// trials that were finished. Every process calls it and gets the same trials.
  std::vector<FitTrial> run(const std::vector<TrialSettings>& batch, TrialFile* file);

  const std::vector<int>& predicted_views() const { return views_.predicted; }

 private:
  class Running;
  using Trials = std::vector<std::optional<FitTrial>>;  // those that there are, of a batch

  void correct_views(const std::vector<TrialSettings>& batch);
  const measurement::Measurement& measurement_for(const TrialSettings& settings) const;
  Trials known_trials(const std::vector<TrialSettings>& batch, const TrialFile* file);
  std::vector<std::unique_ptr<Running>> own_part(const std::vector<TrialSettings>& batch,
                                                 const Trials& trials) const;
  bool take_steps(std::vector<std::unique_ptr<Running>>& own, std::size_t batch_size);
  bool report(const std::vector<std::unique_ptr<Running>>& own, std::size_t batch_size);
  void share(Trials& trials) const;
  Section shared_section(Section section, int owner) const;

  TrialViews views_;
  measurement::Measurement measurement_;  // with nothing corrected
  // By whether beads are masked, and by the part of the background that is subtracted.
  std::map<std::pair<bool, double>, measurement::Measurement> corrected_;
  double part_;  // number of the rows of trials over that of all rows
  const FieldOptions& field_;
  const FitOptions& fit_;
  bool scores_with_view_scale_;
  const TuneHooks& hooks_;
  const distributed::Communicator& processes_;
  base::Stopwatch running_;
  int num_expected_;
  int num_done_ = 0;
  double part_done_ = 0;  // of all trials that are expected
};

}  // namespace tomofield::tune
