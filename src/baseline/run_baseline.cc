#include "baseline/run_baseline.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "base/memory.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "baseline/held_out.h"
#include "baseline/tune.h"
#include "baseline/voxel_problem.h"
#include "io/json.h"
#include "kernels/lanes.h"
#include "measurement/held_out.h"
#include "output/mask_metrics.h"
#include "output/result_files.h"
#include "projection/sample_grid.h"
#include "reconstruct/options_json.h"
#include "selection/trial_series.h"
#include "tomofield/error.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;

projection::SampleGrid grid_of(const measurement::PreparedSeries& series,
                               const BaselineOptions& options) {
  return projection::make_sample_grid(series.geometry, static_cast<double>(series.roi.x0),
                                      static_cast<double>(series.roi.x1),
                                      options.specimen.with_margin ? options.margin_spacing : 0.0);
}

// Estimates the memory: the volumes and detectors of the method, and a pair of slabs and its rays
// for each thread. A tuning holds copies of the rays of its rows.
std::size_t estimate_memory(const measurement::PreparedSeries& plan,
                            const projection::SampleGrid& grid, const MethodFacts& method,
                            const MethodSize& size, bool tunes) {
  constexpr std::size_t kTrialSlabs = selection::kTrialRows / kLanes;
  constexpr std::size_t kFixed = std::size_t{24} << 20;  // program and libraries
  const std::size_t slabs = static_cast<std::size_t>((plan.roi.height() + kLanes - 1) / kLanes);
  const std::size_t rays = static_cast<std::size_t>(plan.geometry.num_views()) *
                           static_cast<std::size_t>(plan.geometry.width) * kLanes;
  const std::size_t values_of_slab = static_cast<std::size_t>(method.volumes) * grid.size() +
                                     static_cast<std::size_t>(method.detectors) * rays;
  const std::size_t values_of_thread =
      SlabPair::kMax * (static_cast<std::size_t>(method.buffers) * grid.size() + rays);
  const std::size_t copied_slabs = tunes ? std::min<std::size_t>(slabs, kTrialSlabs) : 0;
  const std::size_t running =
      size.bytes +
      sizeof(float) * (slabs * values_of_slab + copied_slabs * rays +
                       static_cast<std::size_t>(base::thread_count()) * values_of_thread);
  return kFixed + std::max(running, reading_memory(plan) + sizeof(float) * slabs * rays);
}

base::ProgressReport progress_report(const IterationReport& report, int num_iterations,
                                     std::int64_t num_rays, double seconds) {
  return base::progress_at(static_cast<double>(report.iteration) / num_iterations, seconds,
                           fmt::format("iteration {}  loss {:.4f}", report.iteration,
                                       2 * report.data_loss / static_cast<double>(num_rays)));
}

// Returns the voxels of the region of interest, slab by slab.
output::VoxelSource voxels_of(const VoxelVolume& densities) {
  return [&densities](const field::BoxSink& sink) {
    const projection::SampleSegment& segment = densities.grid().segments().front();
    base::parallel_for(densities.num_slabs(), [&](std::int64_t index) {
      const int slab = static_cast<int>(index);
      const int num_rows = densities.rows_in_slab(slab);
      std::vector<float> values;
      values.reserve(static_cast<std::size_t>(segment.nz) * static_cast<std::size_t>(num_rows) *
                     static_cast<std::size_t>(segment.nx));
      for (int k = 0; k < segment.nz; ++k) {
        const float* row = densities.slab(slab) + segment.origin + k * segment.stride_z();
        for (int lane = 0; lane < num_rows; ++lane) {
          for (int i = 0; i < segment.nx; ++i)
            values.push_back(row[static_cast<std::ptrdiff_t>(i) * kLanes + lane]);
        }
      }
      sink({0, segment.nz, std::int64_t{slab} * kLanes, num_rows, values});
    });
  };
}

output::ModelInfo volume_info(const measurement::PreparedSeries& series,
                              const BaselineOptions& options) {
  output::ModelInfo info;
  info.geometry = series.geometry;
  info.roi = series.roi;
  info.pixel_size_A = series.pixel_size_A;
  info.density_unit = series.unit;
  info.is_dark = options.input.contrast == Contrast::kDark;
  return info;
}

nlohmann::json options_json(const BaselineOptions& options) {
  return {{"input", reconstruction::input_json(options.input)},
          {"specimen", reconstruction::specimen_json(options.specimen)},
          {"with_margin", options.specimen.with_margin},
          {"margin_spacing", options.margin_spacing},
          {"fit_view_scale", options.fit_view_scale},
          {"hold_out", options.hold_out},
          {"tune", options.tune},
          {"method", json_of(options.method)}};
}

// Returns the error of the held-out views as JSON, or null if there are none.
nlohmann::json held_out_json(const VoxelProblem& problem, const std::vector<int>& views,
                             bool fit_view_scale, VoxelVolume& densities) {
  if (views.empty()) return nullptr;
  return measurement::report_held_out(held_out_errors(problem, views, fit_view_scale, densities),
                                      problem.projector().geometry().tilt_deg);
}

nlohmann::json figures_json(const Solution& solution, const VoxelProblem& problem,
                            const measurement::PreparedSeries& series, std::size_t num_parameters,
                            double seconds) {
  nlohmann::json views = nlohmann::json::array();
  for (const int view : problem.views()) {
    const std::size_t v = static_cast<std::size_t>(view);
    views.push_back({{"tilt_deg", series.geometry.tilt_deg[v]},
                     {"scale", problem.view_model(view).scale},
                     {"offset", problem.view_model(view).offset * series.unit},
                     {"noise_sigma", series.noise_sigma[v] * series.unit}});
  }
  for (std::size_t i = 0; i < solution.noise_sigma.size(); ++i)
    views[i]["learned_noise_sigma"] = solution.noise_sigma[i] * series.unit;
  std::vector<double> residuals;
  for (const double loss : solution.data_loss)
    residuals.push_back(2 * loss / static_cast<double>(problem.num_rays()));
  return {{"parameters", num_parameters},
          {"mean_squared_residual_per_noise_variance", residuals},
          {"objective", solution.objective},
          {"density_unit", series.unit},
          {"pixel_size_A", series.pixel_size_A},
          {"size_px", {series.roi.width(), series.roi.height(), series.geometry.thickness}},
          {"seconds", seconds},
          {"threads", base::thread_count()},
          {"mask", output::mask_json(series)},
          {"views", views}};
}

AfterIteration report_to(const base::ProgressSink& progress, const MethodFacts& method,
                         std::int64_t num_rays) {
  return [&progress, method, num_rays, running = base::Stopwatch()](
             const IterationReport& iteration, const VoxelVolume&) {
    if (progress)
      progress(progress_report(iteration, method.iterations, num_rays, running.seconds()));
  };
}

void write_results(const Solution& solution, const measurement::PreparedSeries& series,
                   const BaselineOptions& options, const nlohmann::json& figures,
                   const BaselinePaths& paths) {
  const output::ModelInfo info = volume_info(series, options);
  write_voxels(voxels_of(solution.densities), output::region_box(info, 1.0), info,
               fmt::format("baseline {}", facts_of(options.method).name), options.volume,
               paths.volume);
  io::write_json(
      paths.json,
      {{"tomofield", TOMOFIELD_VERSION}, {"options", options_json(options)}, {"figures", figures}});
}

BaselineSummary summary_of(const Solution& solution, std::int64_t num_rays) {
  return {2 * solution.data_loss.back() / static_cast<double>(num_rays), last_decrease(solution)};
}

}  // namespace

BaselinePaths baseline_paths(const std::filesystem::path& volume) {
  std::filesystem::path stem = volume;
  stem.replace_extension();
  return {volume, stem.string() + ".json", stem};
}

void check_outputs(const BaselineOptions& options) {
  const BaselinePaths paths = baseline_paths(options.output);
  output::check_result_files({paths.volume, paths.json}, paths.picture_prefix, options.input,
                             options.overwrite,
                             "give --overwrite to replace it, or another name with -o");
}

BaselinePlan plan_baseline(const tilt_series::TiltSeries& series, const BaselineOptions& options) {
  const measurement::PreparedSeries planned = plan_series(series, options.specimen);
  if (planned.x_tilt_deg != 0.0) {
    throw Error(fmt::format(
        "the series has an x-axis tilt of {}°, which this baseline does not turn back: leave "
        "--xtilt out (the volume is then turned by it), or use reconstruct or baseline tensorf",
        planned.x_tilt_deg));
  }
  // This and trial_views() throw if there are too few views.
  const std::vector<int> held_out =
      measurement::held_out_views(planned.geometry.tilt_deg, options.hold_out);
  if (options.tune) selection::trial_views(planned.geometry.tilt_deg, held_out);
  const projection::SampleGrid grid = grid_of(planned, options);
  BaselinePlan plan;
  plan.num_views = planned.geometry.num_views();
  plan.geometry = planned.geometry;
  plan.roi = planned.roi;
  plan.pixel_size_A = planned.pixel_size_A;
  plan.num_voxels = num_voxels(grid, planned.roi.height());
  const MethodSize size = size_of(options.method, grid, planned.roi.height());
  plan.num_parameters = size.num_parameters;
  plan.memory_bytes = estimate_memory(planned, grid, facts_of(options.method), size, options.tune);
  const std::string advice = fmt::format(
      "use a larger --bin or --margin-spacing, a smaller --roi or --thickness, or fewer "
      "--threads{}",
      facts_of(options.method).memory_advice);
  base::require_memory(plan.memory_bytes, "this baseline", advice.c_str());
  return plan;
}

BaselineSummary run_baseline(const tilt_series::TiltSeries& tilt_series,
                             const BaselineOptions& requested, const BaselineProgress& progress) {
  BaselineOptions options = requested;
  const BaselinePaths paths = baseline_paths(options.output);
  const measurement::PreparedSeries series =
      prepare_series(tilt_series, options.specimen,
                     paths.volume.has_parent_path() ? paths.volume.parent_path() : ".");
  const std::vector<int> held_out =
      measurement::held_out_views(series.geometry.tilt_deg, options.hold_out);
  nlohmann::json tuning = nullptr;
  if (options.tune) {
    const Tuned tuned =
        tune(options.method, {series, grid_of(series, options), held_out, options.fit_view_scale},
             progress.tuning);
    tuning = tuning_json(tuned);
    options.method = tuned.method;
  }
  VoxelProblem problem(series.geometry, grid_of(series, options), *series.rays, series.noise_sigma,
                       {held_out, options.fit_view_scale});
  const base::Stopwatch running;
  Solution solution =
      reconstruct(problem, options.method, series.mean_density,
                  report_to(progress.reconstruction, facts_of(options.method), problem.num_rays()));
  const double fit_seconds = running.seconds();
  const MethodSize size = size_of(options.method, problem.grid(), problem.num_rows());
  nlohmann::json figures =
      figures_json(solution, problem, series, size.num_parameters, fit_seconds);
  figures["held_out"] =
      held_out_json(problem, held_out, options.fit_view_scale, solution.densities);
  figures["tuning"] = tuning;
  write_results(solution, series, options, figures, paths);
  return summary_of(solution, problem.num_rays());
}

}  // namespace tomofield::baseline
