#include "plan/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "align/alignment.h"
#include "base/check.h"
#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "baseline/run_baseline.h"
#include "evaluate/resolution/block_fsc.h"
#include "evaluate/resolution/local_resolution.h"
#include "fit/domain.h"
#include "fit/fit.h"
#include "fit/stages.h"
#include "measurement/held_out.h"
#include "measurement/prepare.h"
#include "measurement/slab_views.h"
#include "plan/memory_estimate.h"
#include "plan/run_estimate.h"
#include "plan/tile_plan.h"
#include "tomofield/error.h"
#include "tune/trial_measurement.h"
#include "tune/tuning.h"

namespace tomofield::plan {
namespace {

// Returns the peak memory of a process while it aligns the views.
std::size_t memory_of_alignment(const tilt_series::PlannedSeries& series,
                                const measurement::Measurement& plan,
                                options::ReconstructOptions options,
                                const distributed::Communicator& processes) {
  const bool from_raw = options.run.align == Alignment::kFull;
  options.field = alignment::planned_field(options.field);
  options.fit = alignment::planned_fits(plan, from_raw, options.fit.seed).front().options;
  const fit::Domain domain = fit::make_domain(plan.geometry, plan.roi, options.field);
  return estimate_memory({series, plan, domain, options, processes},
                         fit::make_stages(options.field, options.fit)) +
         series.stored_memory(processes) + alignment::memory_beside_fit(plan);
}

// Returns the bytes that writing the results of halves takes: the rays, and a model that is
// sampled, or what compares the volumes or makes linear ones.
std::size_t memory_of_halves(const tilt_series::PlannedSeries& series,
                             const measurement::Measurement& plan, const fit::Domain& domain,
                             const options::ReconstructOptions& options) {
  const auto model = static_cast<std::size_t>(parameter_bytes(
      domain, options.field, options.field.kind, distributed::Communicator::alone()));
  const base::Shape3 shape{plan.roi.width(), plan.roi.height(),
                           static_cast<std::int64_t>(plan.geometry.thickness)};
  const std::size_t linear =
      options.fit.denoising_halves
          ? baseline::plan_baseline(series, {options.files, options, baseline::WbpOptions{}})
                .memory_bytes
          : 0;
  const std::size_t sampling =
      model + static_cast<std::size_t>(base::thread_count()) * thread_memory(plan, domain);
  return kProgramBytes + measurement::SlabViews::resident_memory(plan.rays_shape(), 0) +
         std::max({sampling, evaluate::block_fsc_memory(shape),
                   evaluate::local_resolution_memory(shape), linear});
}

// Returns the peak memory of trials, which are fits of a few rows side by side. Where leaves are
// larger than the region, the field of a trial is as large as that of the run.
std::size_t memory_of_trials(const measurement::Measurement& plan,
                             const options::ReconstructOptions& options, int num_trials,
                             const distributed::Communicator& processes) {
  constexpr int kMostSideBySide = 4;  // tune/automatic_choice.cc
  tune::TrialShape trial = tune::search_trial(options.field, options.fit, plan.geometry.height);
  Rectangle rows = plan.roi;
  rows.y1 = std::min(rows.y1, rows.y0 + trial.rows);
  trial.field.leaf_budget =
      static_cast<int>(std::ceil(trial.field.leaf_budget * static_cast<double>(rows.height()) /
                                 static_cast<double>(plan.roi.height())));
  const fit::Domain domain = fit::make_domain(plan.geometry, rows, trial.field);
  const double of_trial = fitted_bytes(domain, fit::make_stages(trial.field, trial.fit),
                                       trial.field, distributed::Communicator::alone());
  const int side_by_side = std::min(kMostSideBySide, num_trials);
  const int at_once = (side_by_side + processes.size() - 1) / processes.size();
  measurement::SlabViews::Shape rays = plan.rays_shape();
  rays.num_rows = std::min(rays.num_rows, rows.height());
  const std::size_t beside_it = measurement::SlabViews::resident_memory(rays, 2) +
                                thread_memory(plan, domain) +
                                bands_memory(plan, domain, trial.fit, rows.height());
  return kProgramBytes + measurement::SlabViews::resident_memory(plan.rays_shape(), 0) +
         leaves_of_threads(domain) +
         static_cast<std::size_t>(at_once) * (static_cast<std::size_t>(of_trial) + beside_it);
}

// Refuses tilts that cannot be divided: each half needs views over the whole range.
void require_views_for_halves(const measurement::Measurement& plan,
                              const options::ReconstructOptions& options) {
  constexpr int kFewest = 8;
  const int num_views = num_fitted_views(plan, options.fit);
  if (!options.fit.split_tilts || num_views >= kFewest) return;
  throw Error(
      fmt::format("--split-tilts needs {} views or more, and there are {}", kFewest, num_views));
}

void require_views_for_trials(const measurement::Measurement& plan, const FitOptions& options) {
  const std::vector<double>& tilt_deg = plan.geometry.tilt_deg;
  tune::trial_views(tilt_deg, measurement::held_out_views(tilt_deg, options.hold_out));
}

// Returns the largest number of vertices along an axis of a leaf.
int most_vertices(const fit::Domain& domain) {
  int most = 0;
  for (const field::LeafShape& shape : domain.shapes) most = std::max({most, shape.nx, shape.nz});
  return most;
}

}  // namespace

RunPlan plan_run(const tilt_series::PlannedSeries& series, const options::ReconstructOptions& given,
                 const distributed::Communicator& processes) {
  if (processes.size() > 1) base::require_no_faults(given.faults_of_job());
  const measurement::Measurement plan = measurement::plan_measurement(series, given.specimen);
  RunPlan run;
  const tune::OpenSettings open = given.open_settings();
  // Only the views tell whether there is a background or an undecided bead.
  const tune::OpenSettings planned{
      .variation = open.variation, .spikes = open.spikes, .view_scale = open.view_scale};
  run.num_trials = given.num_trials(num_fitted_views(plan, given.fit), planned);
  run.has_too_few_views_for_trials =
      run.num_trials == 0 && given.num_trials(options::kFewestViewsOfTrials, planned) > 0;
  if (run.num_trials > 0) require_views_for_trials(plan, given.fit);
  const options::ReconstructOptions options = run.num_trials > 0 ? given.with_open_prior() : given;
  const fit::Domain domain = plan.ray_geometry
                                 ? fit::make_domain(*plan.ray_geometry, plan.roi, options.field)
                                 : fit::make_domain(plan.geometry, plan.roi, options.field);
  run.num_views = plan.geometry.num_views();
  run.view_width = plan.geometry.width;
  run.view_height = plan.geometry.height;
  run.pixel_size_A = plan.pixel_size_A;
  run.roi = plan.roi;
  run.thickness = plan.geometry.thickness;
  run.num_leaves = domain.tree.num_leaves();
  run.has_large_leaves =
      domain.tree.roots().cell_size > std::max(plan.roi.width(), plan.roi.height());
  run.num_parameters = max_parameters(domain, options.field, options.field.kind);
  run.stages = fit::make_stages(options.field, options.fit);
  const fit::Stage& last = run.stages.back();
  run.steps_an_epoch = steps_an_epoch(plan, options.fit);
  run.num_steps = (last.first_epoch + last.epochs) * run.steps_an_epoch;
  run.tiles = plan_tiles({series, plan, domain, options, processes});
  const bool aligns = options.run.align != Alignment::kOff;
  if (aligns && !options.alignment)
    alignment::require_views(static_cast<std::size_t>(run.num_views));
  run.memory_bytes = run.tiles.is_used()
                         ? run.tiles.memory_bytes
                         : estimate_memory({series, plan, domain, options, processes}, run.stages);
  // Trials of a background count where the views may ask for them and leaves make them large.
  if (const int most_trials = given.num_trials(num_fitted_views(plan, given.fit),
                                               run.has_large_leaves ? open : planned);
      most_trials > 0 && !plan.ray_geometry)
    run.memory_bytes =
        std::max(run.memory_bytes, memory_of_trials(plan, options, most_trials, processes));
  run.most_vertices = most_vertices(domain);
  if (aligns && !plan.ray_geometry)
    run.memory_bytes =
        std::max(run.memory_bytes, memory_of_alignment(series, plan, options, processes));
  if (options.makes_halves()) {
    require_views_for_halves(plan, options);
    run.num_fits = 3;
    run.memory_bytes = std::max(run.memory_bytes, memory_of_halves(series, plan, domain, options));
  }
  return run;
}

void require_memory(const RunPlan& plan, const distributed::Communicator& processes) {
  const std::string advice = fmt::format(
      "use {}a larger --bin or --vertex-spacing, a smaller --roi or --thickness, fewer --threads, "
      "or --budget, which fits tiles and makes them compact",
      plan.has_large_leaves ? "a smaller --leaf-size, since leaves are larger than the region and "
                              "take the memory of their whole area, "
                            : "");
  base::require_memory(plan.memory_bytes * static_cast<std::size_t>(processes.size_on_machine()),
                       "this reconstruction", advice.c_str());
}

RunPlan require_possible_run(const tilt_series::PlannedSeries& series,
                             const options::ReconstructOptions& options,
                             const distributed::Communicator& processes) {
  RunPlan plan = plan_run(series, options, processes);
  require_memory(plan, processes);
  require_few_vertices(plan);
  return plan;
}

void check_before_reading(const options::ReconstructOptions& options,
                          const distributed::Communicator& processes) {
  const tilt_series::PlannedSeries series(options.input(), processes);
  processes.run_collectively([&] {
    const RunPlan plan = require_possible_run(series, options, processes);
    if (processes.is_root() && options.run.align != Alignment::kOff) require_disk(plan, options);
  });
}

void check_alignment_alone(const options::ReconstructOptions& options) {
  const distributed::Communicator& alone = distributed::Communicator::alone();
  const tilt_series::PlannedSeries series(options.input());
  const measurement::Measurement plan = measurement::plan_measurement(series, options.specimen);
  alignment::require_views(series.views().size());
  base::require_memory(memory_of_alignment(series, plan, options, alone), "this alignment",
                       "use a larger --bin, a smaller --roi or --thickness, or fewer --threads");
}

void require_few_vertices(const RunPlan& plan) {
  if (plan.most_vertices <= field::LeafShape::kMaxVertices) return;
  throw Error(fmt::format(
      "{} vertices along an axis of a leaf are more than {}: use a larger --vertex-spacing or "
      "--bin, or a smaller --thickness",
      plan.most_vertices, field::LeafShape::kMaxVertices));
}

}  // namespace tomofield::plan
