#include "selection/trials.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <memory>
#include <utility>

#include "base/enum_names.h"
#include "base/log.h"
#include "base/stopwatch.h"
#include "io/json.h"
#include "selection/trial_series.h"
#include "tomofield/error.h"

namespace tomofield::selection {
namespace {

using nlohmann::json;

// Of those that compare penalties, which differ by more than weights do.
constexpr std::int64_t kPenaltyRows = 32;
constexpr double kPenaltyPart = 0.5;  // of the epochs that plain vertices need

json settings_json(const TrialSettings& s) {
  return {{"tv_penalty", base::name_of(s.penalty)},
          {"tv", s.variation},
          {"rank", s.rank},
          {"epochs", s.epochs}};
}

TrialSettings settings_from(const json& entry) {
  return {.penalty = base::enum_named<Penalty>(entry.at("tv_penalty").get<std::string>()).value(),
          .variation = entry.at("tv"),
          .rank = entry.at("rank"),
          .epochs = entry.at("epochs")};
}

Trial trial_from(const json& entry) {
  return {.settings = settings_from(entry),
          .score = {entry.at("held_out_error"), entry.at("held_out_error_by_view")},
          .seconds = entry.value("seconds", 0.0)};
}

json trials_json(const std::vector<Trial>& trials) {
  json table = json::array();
  for (const Trial& t : trials) {
    table.push_back(settings_json(t.settings));
    table.back().update({{"held_out_error", t.score.error},
                         {"held_out_error_by_view", t.score.view_error},
                         {"seconds", t.seconds}});
  }
  return table;
}

// What trials are made on.
struct Strip {
  double part = 1;  // of all rows
  TrialSeries series;
  measurement::Measurement measurement;  // of `series`
};

Strip middle_strip(const measurement::Measurement& whole, std::int64_t most_rows) {
  const std::int64_t all_rows = whole.rays->shape().num_rows;
  TrialSeries series = make_trial_series(whole.geometry, whole.noise_sigma, *whole.rays,
                                         whole.held_out, most_rows, *whole.processes);
  const std::int64_t rows = series.rays->shape().num_rows;
  geometry::Roi roi = whole.roi;
  roi.y0 += (all_rows - rows) / 2;
  roi.y1 = roi.y0 + rows;
  measurement::Measurement measurement{.geometry = series.geometry,
                                       .roi = roi,
                                       .rays = series.rays.get(),
                                       .noise_sigma = series.noise_sigma,
                                       .mean_density = whole.mean_density,
                                       .held_out = series.held_out};
  return {static_cast<double>(rows) / static_cast<double>(all_rows), std::move(series),
          std::move(measurement)};
}

struct StopRequested {};

// Makes the trials of a search, with its progress.
class TrialFits {
 public:
  TrialFits(const measurement::Measurement& measurement, std::int64_t rows,
            const fit::FieldOptions& field, const fit::FitOptions& fit, const TuneHooks& hooks,
            int num_expected)
      : strip_(middle_strip(measurement, rows)),
        field_(field),
        fit_(fit),
        hooks_(hooks),
        num_expected_(num_expected) {}

  Trial run(const TrialSettings& settings) {
    Trial trial = fitted(settings);
    ++num_done_;
    return trial;
  }

  // As run(), unless `file` has the trial already.
  Trial run(const TrialSettings& settings, TrialFile& file) {
    if (const std::optional<Trial> known = file.find(settings)) {
      ++num_done_;
      return *known;
    }
    Trial trial = run(settings);
    file.add(trial);
    return trial;
  }

  const std::vector<int>& predicted_views() const { return strip_.series.views.predicted; }

 private:
  Trial fitted(const TrialSettings& settings) {
    fit::FieldOptions field = field_;
    fit::FitOptions options = fit_;
    field.rank = settings.rank;
    field.leaf_budget = static_cast<int>(std::ceil(field.leaf_budget * strip_.part));
    options.penalty = settings.penalty;
    options.density_variation = settings.variation;
    options.epochs = settings.epochs;
    options.patience = 0;
    const base::Stopwatch running;
    fit::Fit fit(strip_.measurement, field, options);
    fit.run([&](const fit::Fit&) {
      if (hooks_.stop_requested && hooks_.stop_requested()) throw StopRequested();
      if (hooks_.progress) hooks_.progress(report(fit, settings));
      return true;
    });
    const measurement::HeldOutError error = fit.held_out_error();
    return {settings, {error.total, error.view_error}, running.seconds()};
  }

  base::ProgressReport report(const fit::Fit& fit, const TrialSettings& settings) const {
    const int expected = std::max(num_expected_, num_done_ + 1);
    const double of_trial = fit.work(fit.progress().step) / fit.work(fit.num_steps());
    const auto& errors = fit.progress().held_out_error;
    return base::progress_at(
        (num_done_ + of_trial) / expected, running_.seconds(),
        fmt::format("trial {}/{}  {} tv {:.3g}  rank {}  epochs {}  held out {}", num_done_ + 1,
                    expected, base::name_of(settings.penalty), settings.variation, settings.rank,
                    settings.epochs, errors.empty() ? "-" : fmt::format("{:.4f}", errors.back())));
  }

  Strip strip_;
  const fit::FieldOptions& field_;
  const fit::FitOptions& fit_;
  const TuneHooks& hooks_;
  base::Stopwatch running_;
  int num_expected_;
  int num_done_ = 0;
};

// Half the schedule of the field `plain`; as much less as `fit` is less than usual for `field`.
fit::FitOptions penalty_trial_options(const fit::FieldOptions& plain,
                                      const fit::FieldOptions& field, const fit::FitOptions& fit) {
  const fit::Schedule usual = fit::usual_schedule(plain, fit);
  const double part =
      std::min(1.0, static_cast<double>(fit.epochs) / fit::usual_schedule(field, fit).epochs);
  fit::FitOptions shorter = fit;
  shorter.epochs = std::max(1, static_cast<int>(std::lround(kPenaltyPart * part * usual.epochs)));
  if (fit.coarse_epochs > 0) shorter.coarse_epochs = usual.coarse_epochs_of(shorter.epochs);
  shorter.vertex_epochs = 0;
  shorter.learning_rate = usual.learning_rate;
  return shorter;
}

// What the first process finds, on all of them: trials are too small to share. None if a stop was
// requested.
std::optional<Tuned> found_by_first(const distributed::Communicator& processes,
                                    const std::function<Tuned()>& search) {
  std::optional<Tuned> tuned;
  json found = nullptr;
  processes.run_collectively([&] {
    if (!processes.is_first()) return;
    try {
      tuned = search();
    } catch (const StopRequested&) {
      return;
    }
    found = tuning_json(*tuned);
  });
  found = json::parse(processes.broadcast(found.dump()));
  if (processes.is_first() || found.is_null()) return tuned;
  return tuned_from(found);
}

void log_trials(const std::vector<Trial>& trials) {
  for (const Trial& t : trials) {
    base::log_info(fmt::format("tried {} tv {:8.3f}  rank {:3}  epochs {:4}: held-out error {:.5f}",
                               base::name_of(t.settings.penalty), t.settings.variation,
                               t.settings.rank, t.settings.epochs, t.score.error));
  }
}

}  // namespace

TrialFile::TrialFile(std::filesystem::path path, std::string fingerprint, bool reuse)
    : path_(std::move(path)), fingerprint_(std::move(fingerprint)) {
  if (!reuse || !std::filesystem::exists(path_)) return;
  const char* advice = "give --overwrite instead of --resume to start over";
  std::ifstream file(path_);
  const json document = json::parse(file, nullptr, /*allow_exceptions=*/false);
  try {
    if (document.at("fingerprint").get<std::string>() != fingerprint_) {
      throw Error(fmt::format(
          "cannot resume: the trials in '{}' are of another series or of other options; {}",
          path_.string(), advice));
    }
    for (const json& entry : document.at("trials")) trials_.push_back(trial_from(entry));
  } catch (const json::exception& error) {
    throw Error(fmt::format("cannot resume: '{}' is damaged ({}); {}", path_.string(), error.what(),
                            advice));
  }
}

std::optional<Trial> TrialFile::find(const TrialSettings& settings) const {
  const auto found = std::ranges::find(trials_, settings, &Trial::settings);
  return found == trials_.end() ? std::nullopt : std::optional(*found);
}

void TrialFile::add(const Trial& trial) {
  trials_.push_back(trial);
  io::write_json(path_, {{"fingerprint", fingerprint_}, {"trials", trials_json(trials_)}});
}

json tuning_json(const Tuned& tuned) {
  return {{"predicted_views", tuned.predicted_views},
          {"chosen", settings_json(tuned.settings)},
          {"trials", trials_json(tuned.trials)}};
}

Tuned tuned_from(const json& tuning) {
  Tuned tuned{.settings = settings_from(tuning.at("chosen")),
              .trials = {},
              .predicted_views = tuning.at("predicted_views")};
  for (const json& trial : tuning.at("trials")) tuned.trials.push_back(trial_from(trial));
  return tuned;
}

std::optional<Tuned> tune(const measurement::Measurement& measurement,
                          const fit::FieldOptions& field, const fit::FitOptions& fit,
                          bool tunes_penalty, TrialFile& file, const TuneHooks& hooks) {
  const SearchSpace space{.penalty = tunes_penalty, .rank = field.kind == FieldKind::kVm};
  TrialFits fits(measurement, kTrialRows, field, fit, hooks, expected_trials(space));
  // A run without total variation still needs a weight to search from.
  const double first =
      fit.density_variation > 0 ? fit.density_variation : objective::usual_variation(fit.penalty);
  const auto search = [&] {
    Tuned tuned;
    tuned.predicted_views = fits.predicted_views();
    tuned.settings = search_settings(
        {fit.penalty, first, field.rank, fit.epochs}, space,
        [&](const TrialSettings& settings) { return fits.run(settings, file); }, tuned.trials);
    return tuned;
  };
  const std::optional<Tuned> tuned = found_by_first(*measurement.processes, search);
  if (!tuned) return std::nullopt;
  log_trials(tuned->trials);
  base::log_info(fmt::format(
      "tuned: --tv-penalty {} --tv {:.3f} --rank {} --epochs {} "
      "--vertex-epochs {} --coarse-epochs {}",
      base::name_of(tuned->settings.penalty), tuned->settings.variation, tuned->settings.rank,
      tuned->settings.epochs, fit.vertex_epochs, fit.coarse_epochs));
  return tuned;
}

std::optional<Tuned> tune_penalty(const measurement::Measurement& measurement,
                                  const fit::FieldOptions& field, const fit::FitOptions& fit,
                                  const TuneHooks& hooks) {
  fit::FieldOptions plain = field;
  plain.kind = FieldKind::kGrid;
  const fit::FitOptions shorter = penalty_trial_options(plain, field, fit);
  TrialFits fits(measurement, kPenaltyRows, plain, shorter, hooks, 2);
  const auto search = [&] {
    Tuned tuned;
    tuned.predicted_views = fits.predicted_views();
    tuned.settings =
        choose_penalty({fit.penalty, fit.density_variation, field.rank, shorter.epochs},
                       [&](const TrialSettings& settings) {
                         tuned.trials.push_back(fits.run(settings));
                         return tuned.trials.back();
                       });
    return tuned;
  };
  std::optional<Tuned> tuned = found_by_first(*measurement.processes, search);
  if (!tuned) return std::nullopt;
  log_trials(tuned->trials);
  tuned->settings.epochs = fit.epochs;
  return tuned;
}

}  // namespace tomofield::selection
