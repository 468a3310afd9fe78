#include "plan/run_estimate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "align/alignment.h"
#include "base/plausible.h"
#include "base/progress.h"
#include "fit/stages.h"
#include "io/images/mrc_format.h"
#include "io/images/ome_zarr.h"
#include "io/saving/output_target.h"
#include "io/saving/scratch_memory.h"
#include "measurement/prepare.h"
#include "measurement/slab_views.h"
#include "measurement/surrogate_views.h"
#include "measurement/view_transfers.h"
#include "microscope/view_filter.h"
#include "output/volume.h"
#include "plan/step_times.h"
#include "tune/tuning.h"

namespace tomofield::plan {
namespace {

// Fitted to whole runs (docs/results/estimates.md): what reading a series takes, in times of
// decoding its views once, with the searches for beads and fixed patterns; and what a voxel takes
// at the end, when the volume is written and judged.
constexpr double kReadingsOfAView = 1.3;
constexpr double kSecondsAVoxel = 1e-7;
constexpr double kStart = 0.1;  // seconds: the program, and plots

constexpr int kLargestLeaf = 256;  // larger ones do not fit in the volume that is measured

constexpr std::size_t kSmallFiles = std::size_t{2} << 20;  // metrics and pictures

// Projecting all views for their surrogates takes about this part of an epoch's steps: 0.26 on
// yardstick A at 128 pixels, and 0.15 at 256.
constexpr double kProjection = 0.25;

// Measures the processor time of filtering a view there and back, once for each size.
class FilterTimes {
 public:
  explicit FilterTimes(const measurement::Measurement& plan) : plan_(plan) {}

  // Returns the time for pixels `bin` times as wide, on at most `max_rows` rows.
  double seconds(int bin, double max_rows) {
    const measurement::SlabViews::Shape shape = plan_.rays_shape();
    const auto height =
        static_cast<std::int64_t>(std::min(static_cast<double>(shape.num_rows), max_rows) / bin);
    const auto [place, is_new] = known_.try_emplace({bin, height}, 0.0);
    if (is_new) place->second = measured(bin, shape.width / bin, height);
    return place->second;
  }

 private:
  double measured(int bin, std::int64_t width, std::int64_t height) const {
    const std::size_t tilted = plan_.transfers.size() / 4;  // its number of defoci is near the mean
    const microscope::ViewFilter filter(width, height, plan_.transfers[tilted].binned(bin));
    const std::vector<float> image(static_cast<std::size_t>(width * height), 1.0F);
    const base::ProcessorStopwatch running;
    filter.apply_transpose(filter.apply(image));
    return running.seconds();
  }

  const measurement::Measurement& plan_;
  std::map<std::pair<int, std::int64_t>, double> known_;
};

// Counts steps and samples, in each kind of field.
struct Work {
  FilterTimes& filters;
  double steps_of_vertices = 0, samples_of_vertices = 0;
  double steps_of_factors = 0, samples_of_factors = 0;
  double updates_of_views = 0;  // in times of alignment::seconds_of_update()
  double filter_seconds = 0;    // of filtering views for surrogates

  // Adds the first epochs of a fit of at most `max_rows` rows, `times` times.
  void add_fit(const measurement::Measurement& plan, const FieldOptions& field,
               const FitOptions& fit, int steps_an_epoch, double max_rows, double times,
               std::int64_t epochs = std::numeric_limits<std::int64_t>::max()) {
    const bool has_filters = !plan.transfers.empty();
    for (const fit::Stage& stage : fit::make_stages(field, fit)) {
      const bool is_grid = stage.field_kind == FieldKind::kGrid;
      const std::int64_t made =
          std::clamp<std::int64_t>(epochs - stage.first_epoch, 0, stage.epochs);
      const double epochs_of_all = times * static_cast<double>(made);
      const double steps = epochs_of_all * steps_an_epoch * (has_filters ? 1 + kProjection : 1);
      (is_grid ? steps_of_vertices : steps_of_factors) += steps;
      (is_grid ? samples_of_vertices : samples_of_factors) +=
          steps * samples_of(stage, plan, field, max_rows);
      if (has_filters && epochs_of_all > 0)
        filter_seconds +=
            epochs_of_all * plan.geometry.num_views() * filters.seconds(stage.bin, max_rows);
    }
  }
  // Adds other work, `times` times.
  void add(const Work& other, double times) {
    steps_of_vertices += times * other.steps_of_vertices;
    samples_of_vertices += times * other.samples_of_vertices;
    steps_of_factors += times * other.steps_of_factors;
    samples_of_factors += times * other.samples_of_factors;
    filter_seconds += times * other.filter_seconds;
  }
  double samples() const { return samples_of_vertices + samples_of_factors; }
  double seconds(const StepTimes& times) const {
    return times.vertices.fixed_seconds * steps_of_vertices +
           times.vertices.seconds_a_sample * samples_of_vertices +
           times.factors.fixed_seconds * steps_of_factors +
           times.factors.seconds_a_sample * samples_of_factors + filter_seconds;
  }
};

// Adds the fits of the alignment.
void add_alignment(const measurement::Measurement& plan, const options::ReconstructOptions& options,
                   const RunPlan& run, Work& work) {
  constexpr double kAllRows = std::numeric_limits<double>::infinity();
  const FieldOptions field = alignment::planned_field(options.field);
  const bool from_raw = options.run.align == Alignment::kFull;
  for (const alignment::PlannedFits& fits :
       alignment::planned_fits(plan, from_raw, options.fit.seed)) {
    work.add_fit(plan, field, fits.options, run.steps_an_epoch, kAllRows, fits.times, fits.epochs);
    work.updates_of_views += fits.updates * fits.times * plan.geometry.num_views();
  }
}

// Adds the rows that are fitted beside those of tiles, in the stages that tiles have.
void add_rows_beside_tiles(const measurement::Measurement& plan,
                           const options::ReconstructOptions& options, const RunPlan& run,
                           Work& work) {
  constexpr double kAllRows = std::numeric_limits<double>::infinity();
  const fit::Stage& first = run.stages[static_cast<std::size_t>(run.tiles.num_whole_stages)];
  Work coarse{work.filters}, all{work.filters};
  coarse.add_fit(plan, options.field, options.fit, run.steps_an_epoch, kAllRows, 1,
                 first.first_epoch);
  all.add_fit(plan, options.field, options.fit, run.steps_an_epoch, kAllRows, 1);
  const double beside = run.tiles.repeats() - 1;
  work.add(all, beside);
  work.add(coarse, -beside);
}

// Returns the work of the alignment, of the fit and of the trials that choose its settings.
Work work_of(const measurement::Measurement& plan, const options::ReconstructOptions& options,
             const RunPlan& run, FilterTimes& filters) {
  constexpr double kAllRows = std::numeric_limits<double>::infinity();
  Work work{filters};
  work.add_fit(plan, options.field, options.fit, run.steps_an_epoch, kAllRows, run.num_fits);
  if (run.tiles.is_used()) add_rows_beside_tiles(plan, options, run, work);
  if (options.run.align != Alignment::kOff) add_alignment(plan, options, run, work);
  if (run.num_trials == 0) return work;
  const tune::TrialShape trial =
      tune::search_trial(options.field, options.fit, measurement::largest_reach_px(plan));
  work.add_fit(plan, trial.field, trial.fit, run.steps_an_epoch, static_cast<double>(trial.rows),
               run.num_trials);
  if (options.open_settings().prior) {
    const tune::TrialShape whole = tune::whole_trial(options.field, options.fit);
    work.add_fit(plan, whole.field, whole.fit, run.steps_an_epoch, static_cast<double>(whole.rows),
                 tune::kPriorTrials);
  }
  return work;
}

// Holds the processor times of decoding a view and, with an alignment, of aligning it once.
struct ViewTimes {
  double decoding = 0, update = 0;
};

// Measures them on a view in the middle of the series.
ViewTimes measure_view(const tilt_series::PlannedSeries& series, bool aligns) {
  ViewTimes times;
  const base::ProcessorStopwatch decoding;
  const tilt_series::MaskedImage image =
      tilt_series::decode_view(series, series.views().size() / 2);
  times.decoding = decoding.seconds();
  if (aligns) times.update = alignment::seconds_of_update(image.values, series.width());
  return times;
}

double num_voxels(const RunPlan& run) {
  return static_cast<double>(run.roi.width()) * static_cast<double>(run.roi.height()) *
         std::round(run.thickness);
}

// Returns the bytes of the parameters of all fits.
std::size_t parameter_bytes(const RunPlan& run) {
  return sizeof(float) * run.num_parameters * static_cast<std::size_t>(run.num_fits);
}

// Returns the bytes of the volumes: of halves the tomogram, both halves, the uncertainty and the
// local resolution, and those for other denoisers. The tomogram and the halves may have an
// OME-Zarr.
std::size_t volume_bytes(const RunPlan& run, const options::ReconstructOptions& options) {
  const bool has_halves = run.num_fits > 1;
  const std::int64_t num_volumes = !has_halves ? 1 : options.fit.denoising_halves ? 7 : 5;
  const io::MrcMode mode = output::mrc_mode(options.volume.voxel_type);
  const double bytes_of_one = num_voxels(run) * static_cast<double>(io::bytes_per_value(mode));
  base::CheckedSize bytes =
      base::CheckedSize(num_volumes) * static_cast<std::int64_t>(bytes_of_one);
  if (options.volume.zarr) {
    const std::array<std::int64_t, 3> size{run.roi.width(), run.roi.height(),
                                           std::llround(run.thickness)};
    bytes = bytes + base::CheckedSize(has_halves ? 3 : 1) * io::ome_zarr_bytes(size, mode);
  }
  return static_cast<std::size_t>(bytes.find().value_or(std::numeric_limits<std::int64_t>::max()));
}

// Returns the bytes of the volumes and models that stay. The codes of tiles are small.
std::size_t large_file_bytes(const RunPlan& run, const options::ReconstructOptions& options) {
  return volume_bytes(run, options) + (run.tiles.is_used() ? 0 : parameter_bytes(run));
}

// Returns the bytes of the scratch files of the decoded views and of the rays.
std::size_t scratch_bytes(const tilt_series::PlannedSeries& series,
                          const measurement::Measurement& plan) {
  const std::size_t views = static_cast<std::size_t>(series.width() * series.height()) *
                            series.views().size() * sizeof(float);
  return io::ScratchMemory::bytes_in_file(views) +
         io::ScratchMemory::bytes_in_file(measurement::SlabViews::bytes(plan.rays_shape()));
}

}  // namespace

RunEstimate estimate_run(const tilt_series::PlannedSeries& series,
                         const options::ReconstructOptions& given, const RunPlan& run) {
  const options::ReconstructOptions options = run.num_trials > 0 ? given.with_open_prior() : given;
  measurement::Measurement plan = measurement::plan_measurement(series, options.specimen);
  plan.transfers = measurement::view_transfers(options.input(), options.specimen.hand, series);
  RunEstimate estimate;
  const std::size_t parameters = parameter_bytes(run);
  estimate.result_bytes = large_file_bytes(run, options) + kSmallFiles;
  // A checkpoint has the parameters and two moments, and is there twice while it is replaced. With
  // tiles it is that of the coarse stages.
  const std::size_t in_checkpoint =
      run.tiles.is_used() ? sizeof(float) * run.tiles.coarse_parameters : parameters;
  estimate.disk_bytes = scratch_bytes(series, plan) +
                        std::max(6 * in_checkpoint, estimate.result_bytes + 3 * in_checkpoint);
  if (plan.ray_geometry) return estimate;
  FilterTimes filters(plan);
  const Work work = work_of(plan, options, run, filters);
  estimate.sample_steps = work.samples();
  if (options.field.leaf_size > kLargestLeaf) return estimate;
  const StepTimes times = measure_steps(plan, options.field, options.fit);
  const bool aligns = options.run.align != Alignment::kOff;
  const ViewTimes of_view = measure_view(series, aligns);
  // An alignment reads the series once more, as it was recorded.
  const double readings = aligns ? 2.0 : 1.0;
  estimate.core_seconds =
      kStart + work.seconds(times) + kSecondsAVoxel * num_voxels(run) +
      work.updates_of_views * of_view.update +
      readings * kReadingsOfAView * of_view.decoding * static_cast<double>(series.views().size());
  return estimate;
}

void require_disk(const RunPlan& run, const options::ReconstructOptions& options) {
  const std::filesystem::path& output = options.run.output;
  if (output.empty()) return;
  io::require_room(io::folder_of(output), output,
                   static_cast<std::int64_t>(large_file_bytes(run, options)));
}

}  // namespace tomofield::plan
