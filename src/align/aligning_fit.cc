#include "align/aligning_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/progress.h"
#include "base/threads/parallel.h"
#include "measurement/prepare.h"
#include "objective/constants.h"

namespace tomofield::alignment {
namespace {

// Predicted views take at most this memory together.
constexpr std::size_t kPredictionBytes = std::size_t{1} << 30;

// The first epochs of a fit show too little of the specimen.
constexpr std::int64_t kEpochsBefore = 2;
// With pixels this many times as wide, an update costs as much as an epoch, so every second epoch
// has one.
constexpr int kSlowBin = 2;

// Returns the bytes of a predicted view with pixels `bin` times as wide.
std::size_t prediction_bytes(const measurement::Measurement& measurement, int bin) {
  return measurement::bytes_of_prediction(
      measurement::SlabViews::binned_shape(measurement.rays_shape(), bin));
}

int views_at_once(const measurement::Measurement& measurement, const fit::Stage& stage) {
  return static_cast<int>(
      std::clamp<std::size_t>(kPredictionBytes / (prediction_bytes(measurement, stage.bin) + 1), 1,
                              static_cast<std::size_t>(measurement.geometry.num_views())));
}

std::int64_t epochs_done(const fit::Fit& fit) {
  return fit.progress().step / fit.steps_per_epoch();
}

// Says whether an update is due after an epoch of a stage. At the end of a stage the fit is already
// in the next one, unless it is done.
bool is_update_due(const fit::Stage& stage, std::int64_t epochs_done, bool is_done) {
  const bool is_last = epochs_done == stage.first_epoch + stage.epochs;
  const bool is_turn = stage.bin != kSlowBin || epochs_done % 2 == 0;
  return epochs_done > kEpochsBefore && is_turn && (!is_last || is_done);
}

base::ProgressReport report(const fit::Fit& fit, double seconds,
                            const std::vector<double>& steps_px) {
  const double part = fit.work(fit.progress().step) / fit.work(fit.num_steps());
  return base::progress_at(
      part, seconds, steps_px.empty() ? "" : fmt::format("last step {:.3f} px", steps_px.back()));
}

// Returns how wide the pixels of the next epoch are. At the end of a stage, the fit enters the next
// one, which needs its own.
int bin_of_next_epoch(const fit::Fit& fit) {
  const fit::Stage& stage = fit.stage();
  const std::int64_t end = stage.first_epoch + stage.epochs;
  if (epochs_done(fit) + 1 < end) return stage.bin;
  const auto next = std::ranges::find(fit.stages(), end, &fit::Stage::first_epoch);
  return next == fit.stages().end() ? stage.bin : next->bin;
}

// Lets a fit go on with views that are resampled from the recorded ones.
void resample(const FitInProgress& run, const distributed::Communicator& processes) {
  measurement::realign(run.problem.recorded, run.corrections, bin_of_next_epoch(run.fit),
                       run.problem.scratch_dir, fit::band_rows(run.field), processes,
                       run.measurement);
  run.fit.reread_measurement();
}

// Returns the mean squared difference of a view and its scaled prediction where the pixels are not
// near an edge: there the residual depends more on what the fit knows of the specimen outside the
// views.
double inner_squares(const ImagePair& images, const measurement::ViewModel& model) {
  constexpr double kInner = 0.8;  // part of the width and height
  const auto is_inner = [](std::int64_t place, std::int64_t size) {
    const double half = static_cast<double>(size) / 2;
    return std::abs(static_cast<double>(place) + 0.5 - half) <= kInner * half;
  };
  double squares = 0.0, count = 0.0;
  for (std::int64_t y = 0; y < images.height; ++y) {
    if (!is_inner(y, images.height)) continue;
    for (std::int64_t x = 0; x < images.width; ++x) {
      const auto at = static_cast<std::size_t>(y * images.width + x);
      if (!is_inner(x, images.width) || std::isnan(images.measured[at])) continue;
      const double predicted =
          model.scale * static_cast<double>(images.predicted[at]) + model.offset;
      squares += std::pow(static_cast<double>(images.measured[at]) - predicted, 2);
      count += 1.0;
    }
  }
  return count > 0.0 ? squares / count : 0.0;
}

}  // namespace

FieldOptions aligning_field(FieldOptions field) {
  field.kind = FieldKind::kGrid;
  field.tree = TreeKind::kUniform;
  field.vertex_spacing = std::max(field.vertex_spacing, 1.0);
  field.leaf_size = fit::usual_leaf_size(field);
  return field;
}

FitOptions aligning_fit(int coarse_epochs, int fine_epochs, std::uint64_t seed) {
  constexpr double kStiffness = 2.0, kLearningRate = 0.035;
  FitOptions options;
  options.seed = seed;
  options.penalty = Penalty::kSmooth;
  options.density_variation = kStiffness * objective::usual_variation(options.penalty);
  options.learning_rate = kLearningRate;
  options.coarse_epochs = coarse_epochs;
  options.epochs = fine_epochs;
  options.fit_noise = false;
  options.noise_model = NoiseModel::kWhite;
  return options;
}

void check_stop(const JointProblem& problem, const distributed::Communicator& processes) {
  const bool asked = problem.stop_requested && problem.stop_requested();
  if (processes.allreduce_max(asked ? 1.0 : 0.0) > 0.0) throw base::StopRequested();
}

void run_until(fit::Fit& fit, std::int64_t last_step, const JointProblem& problem,
               const distributed::Communicator& processes) {
  fit.run([&](const fit::Fit& f) {
    if (f.progress().step % f.steps_per_epoch() == 0) check_stop(problem, processes);
    return f.progress().step < last_step;
  });
}

void run_with_wide_pixels(fit::Fit& fit, int coarse_epochs, const JointProblem& problem,
                          const distributed::Communicator& processes) {
  run_until(fit, fit.last_stop_before(std::int64_t{coarse_epochs} * fit.steps_per_epoch()), problem,
            processes);
}

measurement::Measurement aligning_measurement(const JointProblem& problem,
                                              std::span<const geometry::ViewCorrection> corrections,
                                              int bin, const FieldOptions& field,
                                              const distributed::Communicator& processes) {
  measurement::Measurement prepared = problem.plan;
  measurement::realign(problem.recorded, corrections, bin, problem.scratch_dir,
                       fit::band_rows(field), processes, prepared);
  return prepared;
}

ImagePair image_pair(const measurement::PredictedView& view,
                     const measurement::Measurement& measurement, const fit::Stage& stage) {
  const double bin = stage.bin;
  const auto first_row = static_cast<double>(measurement.rays_shape().first_row);
  return {.width = view.width,
          .height = view.height,
          .pixel = bin * measurement.bin_factor,
          .centre_x = static_cast<double>(measurement.geometry.width) / 2 / bin,
          .centre_y = (static_cast<double>(measurement.geometry.height) / 2 - first_row) / bin,
          .measured = view.measured,
          .predicted = view.predicted};
}

LocalRegistrationOptions local_options(const measurement::Measurement& measurement,
                                       const fit::Stage& stage) {
  constexpr double kPrior = 1.0;  // pixels of the fit
  const double width = static_cast<double>(measurement.geometry.width) * measurement.bin_factor;
  const double height = static_cast<double>(measurement.geometry.height) * measurement.bin_factor;
  return {.frame = {.width_px = width, .height_px = height},
          .pixel = stage.bin * measurement.bin_factor,
          .prior_px = kPrior * measurement.bin_factor,
          .pixels_per_sample = pixels_per_sample(RegistrationOptions{}.blur_px)};
}

std::size_t prediction_memory(const measurement::Measurement& measurement) {
  const std::size_t of_view = prediction_bytes(measurement, 1);
  const auto num_views = static_cast<std::size_t>(measurement.geometry.num_views());
  // Three images of each view tell the derivatives by the tilt, with wider pixels.
  const std::size_t by_tilt = num_views * prediction_bytes(measurement, kSlowBin) * 3 / 2;
  return std::max({of_view, by_tilt, std::min(kPredictionBytes, num_views * of_view)});
}

void for_each_prediction(const fit::Fit& fit, const measurement::Measurement& measurement,
                         const fit::Stage& stage,
                         const std::function<void(std::size_t, const ImagePair&)>& visit) {
  const int num_views = measurement.geometry.num_views();
  const int at_once = views_at_once(measurement, stage);
  for (int first = 0; first < num_views; first += at_once) {
    std::vector<int> views(static_cast<std::size_t>(std::min(at_once, num_views - first)));
    std::iota(views.begin(), views.end(), first);
    const auto predicted = fit.predict(views, std::vector<measurement::ViewModel>(views.size()));
    base::parallel_for("register views", std::ssize(views), [&](std::int64_t i) {
      const auto at = static_cast<std::size_t>(i);
      visit(static_cast<std::size_t>(views[at]), image_pair(predicted[at], measurement, stage));
    });
  }
}

std::vector<double> inner_residuals(const fit::Fit& fit,
                                    const measurement::Measurement& measurement,
                                    const fit::Stage& stage) {
  std::vector<double> squares(static_cast<std::size_t>(measurement.geometry.num_views()));
  for_each_prediction(fit, measurement, stage, [&](std::size_t view, const ImagePair& images) {
    squares[view] = inner_squares(images, fit.progress().views[view]);
  });
  return squares;
}

void run_with_updates(const FitInProgress& run, std::int64_t num_epochs,
                      const std::function<bool(const fit::Stage&)>& update,
                      const distributed::Communicator& processes) {
  const base::Stopwatch running;
  fit::Fit& fit = run.fit;
  bool is_updated = false;
  while (epochs_done(fit) < num_epochs) {
    if (is_updated || run.measurement.rays_bin != bin_of_next_epoch(fit)) resample(run, processes);
    const fit::Stage stage = fit.stage();
    fit.run([](const fit::Fit& f) { return f.progress().step % f.steps_per_epoch() != 0; });
    if (run.problem.progress && num_epochs == fit.num_epochs())
      run.problem.progress(report(fit, running.seconds(), run.steps_px));
    check_stop(run.problem, processes);
    is_updated = is_update_due(stage, epochs_done(fit), fit.is_done()) && update(stage);
  }
}

}  // namespace tomofield::alignment
