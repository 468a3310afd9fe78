#include "baseline/run_baseline.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <variant>

#include "base/check.h"
#include "base/log.h"
#include "base/progress.h"
#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "baseline/baseline_record.h"
#include "baseline/tune.h"
#include "baseline/voxel_problem.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_files.h"
#include "io/saving/output_set.h"
#include "io/saving/scratch_memory.h"
#include "kernels/lanes.h"
#include "measurement/ctf_correction.h"
#include "measurement/held_out.h"
#include "measurement/prepare.h"
#include "measurement/undecided_beads.h"
#include "measurement/view_transfers.h"
#include "option_table/setting.h"
#include "option_table/values.h"
#include "output/metrics_record.h"
#include "output/model_file.h"
#include "output/output_paths.h"
#include "output/public_model.h"
#include "output/volume.h"
#include "projection/sample_grid.h"
#include "report/pictures.h"
#include "tilt_series/series_plan.h"
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

AfterIteration report_to(const base::ProgressSink& progress, const MethodFacts& method,
                         std::int64_t num_rays) {
  return [&progress, method, num_rays, running = base::Stopwatch()](
             const IterationReport& iteration, const VoxelVolume&) {
    if (progress)
      progress(progress_report(iteration, method.iterations, num_rays, running.seconds()));
  };
}

// Returns the volume in the input's units and contrast.
Tomogram tomogram_of(const Solution& solution, const measurement::Measurement& series,
                     const BaselineOptions& options) {
  const output::ModelInfo info = output::model_info(series, options.shared.views.contrast);
  const field::OrientedBox box = output::region_box(info, 1.0);
  return output::to_tomogram(info, box, field::gather_box(box, voxels_of(solution.densities)),
                             options.shared.volume.invert);
}

void write_volume(const Solution& solution, const measurement::Measurement& series,
                  const BaselineOptions& options, const std::filesystem::path& path,
                  std::optional<float> largest_density = {}) {
  output::ModelInfo info = output::model_info(series, options.shared.views.contrast);
  info.options_json = options_json(options).dump();
  write_voxels(voxels_of(solution.densities), output::region_box(info, 1.0), info,
               fmt::format("baseline {}", facts_of(options.method).name), options.shared.volume,
               path, distributed::Communicator::alone(), largest_density);
}

// Writes the volume, the record and the pictures of a run, which appear together.
void write_results(const Solution& solution, const measurement::Measurement& series,
                   const tilt_series::TiltSeries& views, const BaselineOptions& options,
                   const BaselineSummary& summary) {
  const output::OutputPaths paths = output::output_paths(options.shared.run.output);
  io::OutputSet results;
  write_volume(solution, series, options, paths.volume);
  io::write_text_file(paths.json, summary.record);
  report::write_run_pictures(results.location_of(paths.volume), views, summary.bead_masking, paths);
  results.commit();
}

// Prepares the views, and corrects their contrast transfer if the options have one.
measurement::Measurement prepare(const tilt_series::TiltSeries& tilt_series,
                                 const BaselineOptions& options,
                                 const std::filesystem::path& scratch_dir) {
  measurement::Measurement series = measurement::prepare_measurement(
      tilt_series, options.shared.specimen, scratch_dir,
      measurement::view_transfers(options.input(), options.shared.specimen.hand, tilt_series));
  if (series.transfers.empty()) return series;
  const base::TraceSpan span("correct contrast transfer");
  measurement::correct_ctf(options.ctf_correction, series);
  base::log_info(
      fmt::format("ctf: views are corrected before ({})", base::name_of(options.ctf_correction)));
  return series;
}

}  // namespace

tilt_series::TiltSeriesOptions BaselineOptions::input() const {
  tilt_series::TiltSeriesOptions input = tilt_series::series_options(files, shared);
  input.images = images;
  return input;
}

void settle(BaselineOptions& options) {
  option_table::Choices choices{std::move(options.files), std::move(options.shared)};
  option_table::settle_settings(choices);
  options.files = std::move(choices.files);
  options.shared = std::move(choices.options);
  const bool by_contrast = options.shared.views.contrast != Contrast::kDark;
  std::visit(
      [&](auto& method) {
        if constexpr (requires { method.non_negative; })
          method.non_negative = options.non_negative.value_or(by_contrast);
      },
      options.method);
}

void check_options(const BaselineOptions& options) {
  constexpr const char* kAdvice = "give --overwrite to replace it, or another name with -o";
  base::require_no_faults(option_table::range_faults(options.shared));
  base::require_no_faults(output::faults_of(options.shared.volume));
  const auto faults = measurement::faults_of_transfer(options.files, options.shared.views);
  base::require_no_faults({faults.begin(), faults.end()});
  if (options.shared.run.output.empty()) return;
  io::require_volume_name(options.shared.run.output);
  const output::OutputPaths paths = output::output_paths(options.shared.run.output);
  std::vector<std::filesystem::path> results{paths.volume, paths.json};
  for (const auto& picture : paths.pictures()) results.push_back(picture);
  const std::vector<std::filesystem::path> inputs = io::input_files(options.files);
  const bool may_replace = options.shared.run.overwrite;
  io::check_output_files(results, inputs, may_replace, kAdvice);
  if (options.shared.volume.zarr) output::check_zarr(paths.volume, inputs, may_replace, kAdvice);
}

bool BaselineOptions::fits_view_scale() const {
  Options chosen = shared;
  option_table::choose_by_contrast(chosen);
  return *chosen.fit.fit_view_scale;
}

std::vector<io::OutputLock> claim_outputs(const BaselineOptions& options) {
  const output::OutputPaths paths = output::output_paths(options.shared.run.output);
  return io::claim_outputs({paths.volume, paths.json}, [&] { check_options(options); });
}

BaselinePlan plan_baseline(const tilt_series::PlannedSeries& series,
                           const BaselineOptions& options) {
  const measurement::Measurement planned =
      measurement::plan_measurement(series, options.shared.specimen);
  if (planned.x_tilt_deg != 0.0) {
    throw Error(fmt::format(
        "the series has an x-axis tilt of {}°, which a linear volume or a baseline does not turn "
        "back: leave --xtilt and --x-axis-tilt out, or --ignore their entries of a project (the "
        "volume is then turned by it), or use reconstruct without --denoising-halves, or baseline "
        "tensorf",
        std::abs(planned.x_tilt_deg)));
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
  const bool fit_view_scale = options.fits_view_scale();
  measurement::Measurement series =
      prepare(tilt_series, options, io::scratch_directory(paths.volume));
  keep_beads(series);  // as bright particles may be the specimen
  const std::vector<int> held_out =
      measurement::held_out_views(series.geometry.tilt_deg, options.shared.fit.hold_out);
  std::optional<Tuned> tuned;
  if (options.shared.fit.tune) {
    tuned = tune(options.method, {series, grid_of(series, options), held_out, fit_view_scale},
                 progress.tuning);
    options.method = tuned->settings;
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
  if (!std::isfinite(solution.data_loss.back()))
    throw Error(
        "the reconstruction diverged: check the numbers of the views and the method's options");
  const double fit_seconds = running.seconds();
  const MethodSize size = size_of(options.method, problem.grid(), problem.num_rows());
  std::optional<measurement::ViewErrors> errors;
  if (!held_out.empty())
    errors = held_out_errors(problem, held_out, fit_view_scale, solution.densities);
  if (errors) output::log_held_out(*errors);
  BaselineSummary summary{.mean_squared_residual = 2 * solution.data_loss.back() /
                                                   static_cast<double>(problem.num_rays()),
                          .last_decrease = last_decrease(solution),
                          .bead_masking = series.masks.bead_masking,
                          .record = record_text({options, series, problem, solution,
                                                 size.num_parameters, fit_seconds, tuned, errors})};
  if (options.shared.run.output.empty()) {
    summary.tomogram = tomogram_of(solution, series, options);
    return summary;
  }
  write_results(solution, series, tilt_series, options, summary);
  return summary;
}

LinearVolume::LinearVolume(const measurement::Measurement& series, const Options& shared)
    : series_(series), options_{{}, shared, WbpOptions{}}, solution_([&] {
        const base::TraceSpan span("linear volume");
        std::vector<int> unused = series.held_out;
        unused.insert(unused.end(), series.left_out.begin(), series.left_out.end());
        std::ranges::sort(unused);
        const VoxelProblem problem(series.geometry, grid_of(series, options_), *series.rays,
                                   series.noise_sigma, {unused, false});
        return reconstruct_wbp(problem, WbpOptions{}, series.mean_density,
                               [](const IterationReport&, VoxelVolume&) {});
      }()) {}

float LinearVolume::largest_density() const {
  return output::largest_density(voxels_of(solution_.densities),
                                 distributed::Communicator::alone());
}

void LinearVolume::write(const std::filesystem::path& path,
                         std::optional<float> largest_density) const {
  write_volume(solution_, series_, options_, path, largest_density);
}

}  // namespace tomofield::baseline
