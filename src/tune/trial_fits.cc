#include "tune/trial_fits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <string>

#include "base/enum_names.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "evaluate/field_artefacts.h"
#include "field/sampling/sample_box.h"
#include "measurement/background.h"
#include "measurement/patch_errors.h"
#include "measurement/undecided_beads.h"
#include "tune/trial_record.h"

namespace tomofield::tune {

// Part of the work after which the time that is left can be told. The first steps take longer.
constexpr double kFirstReport = 0.03;

// A trial that is being made. Its fit lives from the first to the last step.
class TrialFits::Running {
 public:
  Running(std::size_t index, const TrialSettings& settings) : index_(index), settings_(settings) {}

  void begin(const TrialFits& trials) {
    const base::Stopwatch stopwatch;
    FieldOptions field = trials.field_;
    FitOptions options = trials.fit_;
    field.rank = settings_.rank;
    field.leaf_budget = static_cast<int>(std::ceil(field.leaf_budget * trials.part_));
    options.penalty = settings_.penalty;
    options.density_variation = settings_.variation;
    options.epochs = settings_.epochs;
    options.spike_rank = settings_.spike_rank;
    options.prior = settings_.prior;
    options.fit_view_scale = settings_.fits_view_scale;
    options.patience = 0;
    scores_with_view_scale_ = trials.scores_with_view_scale_;
    measurement_ = &trials.measurement_for(settings_);
    if (field.kind == FieldKind::kVm) rank_ = fmt::format("  rank {}", settings_.rank);
    fit_ = std::make_unique<fit::Fit>(*measurement_, field, options,
                                      distributed::Communicator::alone(),
                                      fit::FitPart{.scores_epochs = false});
    seconds_ += stopwatch.seconds();
  }

  // Takes a step, unless the trial is finished. The last step gives the score.
  void take_step() {
    took_step_ = !finished_;
    if (!took_step_) return;
    const base::Stopwatch stopwatch;
    fit_->run([](const fit::Fit&) { return false; });
    const bool is_last = fit_->is_done();
    part_done_ = is_last ? 1.0 : fit_->work(fit_->progress().step) / fit_->work(fit_->num_steps());
    detail_ = fmt::format("{} tv {:.3g}{}  epochs {}{}", base::name_of(settings_.penalty),
                          settings_.variation, rank_, settings_.epochs,
                          settings_.prior == Prior::kLearned ? "  learned prior" : "");
    if (is_last)
      finished_ = FitTrial{.settings = settings_,
                           .score = score(),
                           .seconds = 0.0,
                           .section = {measurement_->roi.width(),
                                       field::middle_plane(fit_->field(), measurement_->roi)}};
    seconds_ += stopwatch.seconds();
    if (!is_last) return;
    finished_->seconds = seconds_;
    fit_.reset();
  }

  std::size_t index() const { return index_; }  // in the batch
  bool took_step() const { return took_step_; }
  double part_done() const { return part_done_; }
  const std::string& detail() const { return detail_; }
  const std::optional<FitTrial>& finished() const { return finished_; }

 private:
  HeldOutScore score() const {
    fit::Fit::HeldOut held_out = fit_->predict_held_out(scores_with_view_scale_);
    measurement::ViewErrors& error = held_out.errors;
    std::vector<double> noise_weight;
    for (const measurement::ViewModel& model : error.models) noise_weight.push_back(model.weight);
    std::vector<double> patch_error = measurement::patch_errors(held_out.views, noise_weight);
    const Rectangle& roi = measurement_->roi;
    const evaluate::FieldArtefacts artefacts =
        evaluate::find_artefacts(fit_->field(), roi, {0, static_cast<int>(roi.height())});
    std::optional<double> face_jump;
    if (artefacts.faces) face_jump = artefacts.faces->both;
    return {error.total, std::move(error.view_error), std::move(patch_error), artefacts.speckle,
            face_jump};
  }

  std::size_t index_;
  TrialSettings settings_;
  bool scores_with_view_scale_ = false;
  const measurement::Measurement* measurement_ = nullptr;
  std::unique_ptr<fit::Fit> fit_;
  std::optional<FitTrial> finished_;
  bool took_step_ = false;
  double part_done_ = 0, seconds_ = 0;
  std::string rank_, detail_;  // factors alone have a rank
};

TrialFits::TrialFits(const measurement::Measurement& measurement, std::int64_t rows,
                     const FieldOptions& field, const FitOptions& fit, bool scores_with_view_scale,
                     const TuneHooks& hooks, int num_expected,
                     const distributed::Communicator& processes)
    : views_(trial_views(measurement.geometry.tilt_deg, measurement.held_out)),
      measurement_(trial_measurement(measurement, views_, rows, processes)),
      part_(static_cast<double>(measurement_.rays->shape().num_rows) /
            static_cast<double>(measurement.rays->shape().num_rows)),
      field_(field),
      fit_(fit),
      scores_with_view_scale_(scores_with_view_scale),
      hooks_(hooks),
      processes_(processes),
      num_expected_(num_expected) {}

std::vector<FitTrial> TrialFits::run(const std::vector<TrialSettings>& batch, TrialFile* file) {
  const base::TraceSpan span("trials");
  correct_views(batch);
  Trials trials = known_trials(batch, file);
  const Trials known = trials;
  auto own = own_part(batch, trials);
  const bool was_stopped = take_steps(own, batch.size());
  for (const auto& trial : own) trials[trial->index()] = trial->finished();
  share(trials);
  processes_.run_collectively([&] {
    for (std::size_t i = 0; i < trials.size() && file && processes_.is_root(); ++i) {
      if (!trials[i] || known[i]) continue;
      file->add(*trials[i]);
    }
  });
  if (was_stopped) throw base::StopRequested();
  num_done_ += static_cast<int>(batch.size());
  std::vector<FitTrial> all;
  for (const auto& trial : trials) all.push_back(trial.value());
  return all;
}

// Makes the measurements that these trials need. Beads are hidden in the predicted views of all, so
// that all predict the same rays.
void TrialFits::correct_views(const std::vector<TrialSettings>& batch) {
  std::vector<int> all_views(static_cast<std::size_t>(measurement_.geometry.num_views()));
  std::iota(all_views.begin(), all_views.end(), 0);
  for (const TrialSettings& s : batch) {
    if (corrected_.contains({s.masks_beads, s.background_part})) continue;
    measurement::Measurement corrected = measurement::with_beads_hidden(
        measurement_, s.masks_beads ? all_views : measurement_.held_out);
    if (s.background_part > 0)
      corrected = measurement::without_background(s.background_part, corrected);
    corrected_.emplace(std::pair(s.masks_beads, s.background_part), std::move(corrected));
  }
}

const measurement::Measurement& TrialFits::measurement_for(const TrialSettings& s) const {
  return corrected_.at({s.masks_beads, s.background_part});
}

// Returns the trials that the root finds in its file.
TrialFits::Trials TrialFits::known_trials(const std::vector<TrialSettings>& batch,
                                          const TrialFile* file) {
  Trials trials(batch.size());
  if (!file) return trials;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    const auto trial = processes_.is_root() ? file->find(batch[i]) : std::nullopt;
    const std::string text = processes_.broadcast(trial ? text_of(*trial) : "");
    if (!text.empty()) trials[i] = trial_from_text(text);
  }
  return trials;
}

// Returns the trials that are missing, of which the processes get one after another.
std::vector<std::unique_ptr<TrialFits::Running>> TrialFits::own_part(
    const std::vector<TrialSettings>& batch, const Trials& trials) const {
  std::vector<std::unique_ptr<Running>> own;
  int num_missing = 0;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (trials[i]) continue;
    if (num_missing++ % processes_.size() == processes_.rank())
      own.push_back(std::make_unique<Running>(i, batch[i]));
  }
  return own;
}

// Takes steps until all processes have finished their trials. Returns true if a stop was requested
// of any process.
bool TrialFits::take_steps(std::vector<std::unique_ptr<Running>>& own, std::size_t batch_size) {
  const auto for_own = [&](const char* what, const auto& body) {
    processes_.run_collectively([&] {
      base::parallel_for(what, std::ssize(own),
                         [&](std::int64_t i) { body(*own[static_cast<std::size_t>(i)]); });
    });
  };
  for_own("begin trials", [&](Running& trial) { trial.begin(*this); });
  for (;;) {
    for_own("steps of trials", [](Running& trial) { trial.take_step(); });
    const bool stop = report(own, batch_size);
    const bool is_done = std::ranges::all_of(own, [](const auto& t) { return !!t->finished(); });
    const double wanted = processes_.allreduce_max(stop ? 2.0 : is_done ? 0.0 : 1.0);
    if (wanted != 1.0) return wanted == 2.0;
  }
}

// Calls the hooks for each step that was taken. Returns true if a stop was requested.
bool TrialFits::report(const std::vector<std::unique_ptr<Running>>& own, std::size_t batch_size) {
  const int expected = std::max(num_expected_, num_done_ + static_cast<int>(batch_size));
  double of_batch = 0;
  for (const auto& trial : own) of_batch += trial->part_done() / static_cast<double>(own.size());
  for (const auto& trial : own) {
    if (!trial->took_step()) continue;
    if (hooks_.stop_requested && hooks_.stop_requested()) return true;
    if (!hooks_.progress) continue;
    const double done = num_done_ + of_batch * static_cast<double>(batch_size);
    part_done_ = std::max(part_done_, done / expected);  // more trials than expected may follow
    if (part_done_ < kFirstReport) continue;
    hooks_.progress(base::progress_at(
        part_done_, running_.seconds(),
        fmt::format("trial {} of about {}  {}", num_done_ + static_cast<int>(trial->index()) + 1,
                    expected, trial->detail())));
  }
  return false;
}

// Returns the section that `owner` has on every process.
Section TrialFits::shared_section(Section section, int owner) const {
  double sizes[] = {static_cast<double>(section.width), static_cast<double>(section.values.size())};
  for (double& size : sizes) size = processes_.allreduce_max(size);
  section.width = static_cast<std::int64_t>(sizes[0]);
  section.values.resize(static_cast<std::size_t>(sizes[1]));
  processes_.broadcast(std::as_writable_bytes(std::span(section.values)), owner);
  return section;
}

// Gives the trials that any process has finished to all of them.
void TrialFits::share(Trials& trials) const {
  if (processes_.size() == 1) return;
  for (auto& trial : trials) {
    const double owner = processes_.allreduce_max(trial ? processes_.rank() : -1);
    if (owner < 0) continue;
    const std::string text = trial ? text_of(*trial) : "";
    Section section = trial ? std::move(trial->section) : Section();
    trial = trial_from_text(processes_.broadcast(text, static_cast<int>(owner)));
    trial->section = shared_section(std::move(section), static_cast<int>(owner));
  }
}

}  // namespace tomofield::tune
