#include "baseline/run_baseline.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "base/check.h"
#include "base/log.h"
#include "base/stopwatch.h"
#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "baseline/tune.h"
#include "baseline/voxel_problem.h"
#include "io/json.h"
#include "io/saving/output_files.h"
#include "io/saving/scratch_memory.h"
#include "kernels/lanes.h"
#include "measurement/ctf_correction.h"
#include "measurement/held_out.h"
#include "measurement/undecided_beads.h"
#include "measurement/view_size.h"
#include "measurement/view_transfers.h"
#include "option_table/setting.h"
#include "option_table/values.h"
#include "output/metrics.h"
#include "output/output_paths.h"
#include "output/shared_options.h"
#include "output/volume.h"
#include "projection/sample_grid.h"
#include "tomofield/error.h"
#include "tune/trial_measurement.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;

projection::SampleGrid grid_of(const measurement::Measurement& series,
                               const BaselineOptions& options) {
  return projection::make_sample_grid(
      series.geometry, static_cast<double>(series.roi.x0), static_cast<double>(series.roi.x1),
      options.shared.field.with_margin ? options.shared.field.margin_spacing : 0.0);
}

bool fits_view_scale(const BaselineOptions& options) {
  Options shared = options.shared;
  option_table::choose_by_contrast(shared);
  return *shared.fit.fit_view_scale;
}

// Estimates the memory: the volumes and detectors of the method, and a pair of slabs and its rays
// for each thread. A tuning holds copies of the rays of its rows.
std::size_t estimate_memory(const measurement::Measurement& plan,
                            const projection::SampleGrid& grid, const MethodFacts& method,
                            const MethodSize& size, std::size_t stored_views, std::size_t decoding,
                            bool tunes) {
  constexpr std::size_t kTrialSlabs = tune::kTrialRows / kLanes;
  constexpr std::size_t kFixed = std::size_t{24} << 20;  // program and libraries
  const std::size_t slabs = static_cast<std::size_t>((plan.roi.height() + kLanes - 1) / kLanes);
  const std::size_t rays = static_cast<std::size_t>(plan.geometry.num_views()) *
                           static_cast<std::size_t>(plan.geometry.width) * kLanes;
  const std::size_t values_of_slab = static_cast<std::size_t>(method.volumes) * grid.size() +
                                     static_cast<std::size_t>(method.detectors) * rays;
  const std::size_t values_of_thread =
      SlabPair::kMaxSlabs * (static_cast<std::size_t>(method.buffers) * grid.size() + rays);
  const std::size_t copied_slabs = tunes ? std::min<std::size_t>(slabs, kTrialSlabs) : 0;
  const std::size_t running =
      size.bytes +
      sizeof(float) * (slabs * values_of_slab + copied_slabs * rays +
                       static_cast<std::size_t>(base::thread_count()) * values_of_thread);
  // The stored views make room for the rays one by one.
  return kFixed +
         std::max(running, decoding + std::max(sizeof(float) * slabs * rays, stored_views));
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
    base::parallel_for("write slabs", densities.num_slabs(), [&](std::int64_t index) {
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

nlohmann::json options_json(const BaselineOptions& options) {
  const Options& shared = options.shared;
  const nlohmann::json all = option_table::to_json({options.files, shared});
  return {{"input", all["input"]},
          {"ctf_correction", base::name_of(options.ctf_correction)},
          {"specimen", all["specimen"]},
          {"with_margin", shared.field.with_margin},
          {"margin_spacing", shared.field.margin_spacing},
          {"fit_view_scale", fits_view_scale(options)},
          {"hold_out", shared.fit.hold_out},
          {"tune", shared.fit.tune},
          {"method", json_of(options.method)}};
}

// Returns the error of the held-out views as JSON, or null if there are none.
nlohmann::json held_out_json(const VoxelProblem& problem, const std::vector<int>& views,
                             bool fit_view_scale, VoxelVolume& densities) {
  if (views.empty()) return nullptr;
  return measurement::report_held_out(held_out_errors(problem, views, fit_view_scale, densities),
                                      problem.projector().geometry().tilt_deg);
}

nlohmann::json metrics_json(const Solution& solution, const VoxelProblem& problem,
                            const measurement::Measurement& series, std::size_t num_parameters,
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
          {"threads_why", base::describe_threads()},
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

void write_volume(const Solution& solution, const measurement::Measurement& series,
                  const BaselineOptions& options, const std::filesystem::path& path) {
  output::ModelInfo info = output::model_info(series, options.shared.views.contrast);
  info.options_json = options_json(options).dump();
  write_voxels(voxels_of(solution.densities), output::region_box(info, 1.0), info,
               fmt::format("baseline {}", facts_of(options.method).name), options.shared.volume,
               path);
}

void write_results(const Solution& solution, const measurement::Measurement& series,
                   const BaselineOptions& options, const nlohmann::json& metrics,
                   const output::OutputPaths& paths) {
  write_volume(solution, series, options, paths.volume);
  io::write_json(paths.json, {{"tomofield", TOMOFIELD_VERSION},
                              {"options", options_json(options)},
                              {"origins", option_table::settings_json(options.shared.settings)},
                              {"metrics", metrics}});
}

BaselineSummary summary_of(const Solution& solution, std::int64_t num_rays,
                           const measurement::Measurement& series) {
  return {2 * solution.data_loss.back() / static_cast<double>(num_rays), last_decrease(solution),
          series.masks.bead_masking};
}

// Prepares the views, and corrects their contrast transfer if the options have one.
measurement::Measurement prepare(const tilt_series::TiltSeries& tilt_series,
                                 const BaselineOptions& options,
                                 const std::filesystem::path& scratch_dir) {
  measurement::Measurement series = measurement::prepare_measurement(
      tilt_series, options.shared.specimen, scratch_dir,
      measurement::view_transfers(output::series_options(options.files, options.shared),
                                  options.shared.specimen.hand, tilt_series));
  if (series.transfers.empty()) return series;
  const base::TraceSpan span("correct contrast transfer");
  measurement::correct_ctf(options.ctf_correction, series);
  base::log_info(
      fmt::format("ctf: views are corrected before ({})", base::name_of(options.ctf_correction)));
  return series;
}

}  // namespace

void check_options(const BaselineOptions& options) {
  constexpr const char* kAdvice = "give --overwrite to replace it, or another name with -o";
  base::require_no_faults(option_table::range_faults(options.shared));
  const auto faults = measurement::faults_of_transfer(options.files, options.shared.views);
  base::require_no_faults({faults.begin(), faults.end()});
  io::require_volume_name(options.shared.run.output);
  const output::OutputPaths paths = output::output_paths(options.shared.run.output);
  std::vector<std::filesystem::path> results = paths.pictures();
  results.insert(results.end(), {paths.volume, paths.json});
  io::check_output_files(results, io::input_files(options.files), options.shared.run.overwrite,
                         kAdvice);
  if (options.shared.volume.zarr)
    output::check_zarr(paths.volume, options.shared.run.overwrite, kAdvice);
}

std::vector<io::OutputLock> claim_outputs(const BaselineOptions& options) {
  const output::OutputPaths paths = output::output_paths(options.shared.run.output);
  return io::claim_outputs({paths.volume, paths.json}, [&] { check_options(options); });
}

BaselinePlan plan_baseline(const tilt_series::PlannedSeries& series,
                           const BaselineOptions& options) {
  const measurement::Measurement planned =
      measurement::plan_measurement(series, options.shared.specimen);
  measurement::require_pixels(planned.geometry.width, planned.geometry.height);
  if (planned.x_tilt_deg != 0.0) {
    throw Error(fmt::format(
        "the series has an x-axis tilt of {}°, which this baseline does not turn back: leave "
        "--xtilt out (the volume is then turned by it), or use reconstruct or baseline tensorf",
        planned.x_tilt_deg));
  }
  // This and trial_views() throw if there are too few views.
  const std::vector<int> held_out =
      measurement::held_out_views(planned.geometry.tilt_deg, options.shared.fit.hold_out);
  if (options.shared.fit.tune) tune::trial_views(planned.geometry.tilt_deg, held_out);
  const projection::SampleGrid grid = grid_of(planned, options);
  BaselinePlan plan;
  plan.num_views = planned.geometry.num_views();
  plan.geometry = planned.geometry;
  plan.roi = planned.roi;
  plan.pixel_size_A = planned.pixel_size_A;
  plan.num_voxels = num_voxels(grid, planned.roi.height());
  const MethodSize size = size_of(options.method, grid, planned.roi.height());
  plan.num_parameters = size.num_parameters;
  plan.memory_bytes = estimate_memory(planned, grid, facts_of(options.method), size,
                                      series.stored_memory(distributed::Communicator::alone()),
                                      decoding_memory(series, planned), options.shared.fit.tune);
  const std::string advice = fmt::format(
      "use a larger --bin or --margin-spacing, a smaller --roi or --thickness, or fewer "
      "--threads{}",
      facts_of(options.method).memory_advice);
  base::require_memory(plan.memory_bytes, "this baseline", advice.c_str());
  return plan;
}

BaselineSummary run_baseline(const tilt_series::TiltSeries& tilt_series,
                             const BaselineOptions& requested, const BaselineProgress& progress) {
  base::log_info(base::describe_threads());
  BaselineOptions options = requested;
  const output::OutputPaths paths = output::output_paths(options.shared.run.output);
  const bool fit_view_scale = fits_view_scale(options);
  measurement::Measurement series =
      prepare(tilt_series, options, io::scratch_directory(paths.volume));
  keep_beads(series);  // as bright particles may be the specimen
  const std::vector<int> held_out =
      measurement::held_out_views(series.geometry.tilt_deg, options.shared.fit.hold_out);
  nlohmann::json tuning = nullptr;
  if (options.shared.fit.tune) {
    const Tuned tuned =
        tune(options.method, {series, grid_of(series, options), held_out, fit_view_scale},
             progress.tuning);
    tuning = tuning_json(tuned);
    options.method = tuned.settings;
  }
  VoxelProblem problem(series.geometry, grid_of(series, options), *series.rays, series.noise_sigma,
                       {held_out, fit_view_scale});
  const base::Stopwatch running;
  Solution solution = [&] {
    const base::TraceSpan span("solve");
    return reconstruct(
        problem, options.method, series.mean_density,
        report_to(progress.reconstruction, facts_of(options.method), problem.num_rays()));
  }();
  const double fit_seconds = running.seconds();
  const MethodSize size = size_of(options.method, problem.grid(), problem.num_rows());
  nlohmann::json metrics =
      metrics_json(solution, problem, series, size.num_parameters, fit_seconds);
  metrics["held_out"] = held_out_json(problem, held_out, fit_view_scale, solution.densities);
  metrics["tuning"] = tuning;
  write_results(solution, series, options, metrics, paths);
  return summary_of(solution, problem.num_rays(), series);
}

void write_linear_volume(const measurement::Measurement& series, const Options& shared,
                         const std::filesystem::path& path) {
  const base::TraceSpan span("linear volume");
  const BaselineOptions options{{}, shared, WbpOptions{}};
  std::vector<int> unused = series.held_out;
  unused.insert(unused.end(), series.left_out.begin(), series.left_out.end());
  std::ranges::sort(unused);
  const VoxelProblem problem(series.geometry, grid_of(series, options), *series.rays,
                             series.noise_sigma, {unused, false});
  write_volume(reconstruct_wbp(problem, WbpOptions{}, series.mean_density,
                               [](const IterationReport&, VoxelVolume&) {}),
               series, options, path);
}

}  // namespace tomofield::baseline
