#include "plan/step_times.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "base/progress.h"
#include "base/random.h"
#include "base/statistics.h"
#include "base/threads/parallel.h"
#include "fit/domain.h"
#include "fit/fit.h"
#include "kernels/lanes.h"
#include "measurement/slab_views.h"

namespace tomofield::plan {
namespace {

// Limits of the small volume. Its slabs are too large for the first cache, as those of real series
// are, and there is a band for each thread.
constexpr std::int64_t kMostColumns = 256;
constexpr double kMostThickness = 160;
constexpr int kMostBands = 8;
constexpr std::int64_t kStepsOfLastStage = 6;

// Returns rays of noise with the views of `plan`, in a part of its volume.
measurement::Measurement small_measurement(const measurement::Measurement& plan,
                                           const FieldOptions& field) {
  const std::int64_t width = std::min(plan.geometry.width, kMostColumns);
  const int bands = std::min(base::thread_count(), kMostBands);
  const std::int64_t rows = std::min(plan.roi.height(), bands * fit::band_rows(field));
  measurement::Measurement small;
  small.geometry = geometry::centred_geometry(
      width, rows, std::min(plan.geometry.thickness, kMostThickness), plan.geometry.tilt_deg);
  small.roi = {0, 0, width, rows};
  small.noise_sigma.assign(plan.geometry.tilt_deg.size(), 1.0);
  small.mean_density = 0.3;
  small.rays = std::make_shared<measurement::SlabViews>(
      small.rays_shape(), 1.0,
      [&](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
        base::Random random(1, view);
        for (float& value : image) value = static_cast<float>(1 + random.uniform());
        std::ranges::fill(valid, std::uint8_t{1});
      },
      "");
  return small;
}

// Returns the options of a fit with one epoch a stage.
FitOptions one_epoch_a_stage(const std::vector<fit::Stage>& stages, FitOptions options) {
  options.coarse_epochs = static_cast<int>(
      std::ranges::count_if(stages, [](const fit::Stage& stage) { return stage.bin > 1; }));
  options.vertex_epochs = std::min(*options.vertex_epochs, 1);
  options.epochs = 1;
  options.hold_out = 0;
  options.patience = 0;
  options.prior = Prior::kTv;  // its stages have steps as those before
  return options;
}

// Returns the median time of a step of each stage. The first step of a stage makes its objects, and
// the last one ends an epoch.
std::vector<double> seconds_of_steps(fit::Fit& fit) {
  std::vector<std::vector<double>> times(fit.stages().size());
  const std::int64_t steps = fit.steps_per_epoch();
  std::optional<base::ProcessorStopwatch> step(std::in_place);
  fit.run([&](const fit::Fit& state) {
    const std::int64_t done = state.progress().step;
    const auto stage = static_cast<std::size_t>((done - 1) / steps);
    times[stage].push_back(step->seconds());
    step.emplace();
    return stage + 1 < times.size() || (done - 1) % steps < kStepsOfLastStage;
  });
  std::vector<double> medians;
  for (const std::vector<double>& of_stage : times) medians.push_back(base::median(of_stage));
  return medians;
}

// Returns the line through two stages: what a step costs by itself, and what a sample costs.
StepTime line_through(double coarse_samples, double coarse_seconds, double fine_samples,
                      double fine_seconds) {
  const double slope =
      std::max(fine_seconds - coarse_seconds, 0.0) / std::max(fine_samples - coarse_samples, 1.0);
  const double fixed = std::clamp(fine_seconds - slope * fine_samples, 0.0, fine_seconds);
  return {fixed, (fine_seconds - fixed) / fine_samples};
}

}  // namespace

double samples_of(const fit::Stage& stage, const measurement::Measurement& plan,
                  const FieldOptions& field, double max_rows) {
  const fit::Domain domain = fit::make_domain(plan.geometry, plan.roi, field);
  const double rows = std::min(static_cast<double>(domain.num_rows), max_rows) / stage.bin;
  return std::ceil(rows / kernels::kLanes) *
         static_cast<double>(sample_grid(domain, plan.geometry.thickness, stage.bin).size());
}

StepTimes measure_steps(const measurement::Measurement& plan, const FieldOptions& field,
                        const FitOptions& fit) {
  const measurement::Measurement small = small_measurement(plan, field);
  FieldOptions inside = field;
  inside.with_margin = false;
  const FitOptions options = one_epoch_a_stage(fit::make_stages(field, fit), fit);
  fit::Fit fitted(small, inside, options);
  const std::vector<double> seconds = seconds_of_steps(fitted);
  const std::vector<fit::Stage>& stages = fitted.stages();
  std::vector<double> samples;
  for (const fit::Stage& stage : stages)
    samples.push_back(samples_of(stage, small, inside, static_cast<double>(small.roi.height())));
  const auto last_of = [&](FieldKind kind) {
    std::optional<std::size_t> found;
    for (std::size_t i = 0; i < stages.size(); ++i)
      if (stages[i].field_kind == kind) found = i;
    return found;
  };
  StepTimes times;
  for (const FieldKind kind : {FieldKind::kGrid, FieldKind::kVm}) {
    const auto last = last_of(kind);
    if (!last) continue;
    const bool has_coarser = stages.front().field_kind == kind && *last > 0;
    StepTime& time = kind == FieldKind::kGrid ? times.vertices : times.factors;
    time = has_coarser
               ? line_through(samples.front(), seconds.front(), samples[*last], seconds[*last])
               : StepTime{0, seconds[*last] / samples[*last]};
  }
  if (!last_of(FieldKind::kGrid)) times.vertices = times.factors;  // for trials, an upper limit
  return times;
}

}  // namespace tomofield::plan
