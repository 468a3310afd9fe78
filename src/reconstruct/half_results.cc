#include "reconstruct/half_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/utf8.h"
#include "baseline/run_baseline.h"
#include "evaluate/resolution/block_fsc.h"
#include "evaluate/resolution/local_resolution.h"
#include "evaluate/uncertainty.h"
#include "io/saving/output_set.h"
#include "output/output_paths.h"
#include "output/volume.h"
#include "reconstruct/halves.h"
#include "reconstruct/results.h"
#include "reconstruct/run_files.h"
#include "reconstruct/run_pages.h"
#include "report/choice_plot.h"
#include "report/pictures.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

using tilt_series::Half;

// Holds the resolution that a comparison of the volumes of both halves gives.
struct Agreement {
  evaluate::Fsc fsc;
  std::optional<evaluate::Fsc> linear_fsc;  // of the linear halves, if they are written
  evaluate::LocalResolution local;
};

const output::OutputPaths::OfHalf& paths_of(const Run& run, Half half) {
  return run.paths.halves[static_cast<std::size_t>(half)];
}

// Returns the tilts that a volume of this run was measured from.
evaluate::TiltRange tilt_range(const Run& run) {
  const std::vector<double>& tilt_deg = run.measurement.geometry.tilt_deg;
  const auto [low, high] = std::ranges::minmax(tilt_deg);
  const VolumeAxes axes = run.options.volume.axes;
  return run.measurement.geometry.hand == 1 ? evaluate::TiltRange{low, high, axes}
                                            : evaluate::TiltRange{-high, -low, axes};
}

// Samples one model after the other. Scaled integers have one factor in all volumes, so that these
// compare.
void write_volumes(const Run& run) {
  VolumeOptions options = run.options.volume;
  output::VolumePart part;
  std::vector<std::pair<std::filesystem::path, std::filesystem::path>> volumes_of_models{
      {run.paths.model, run.paths.volume}};
  for (const Half half : tilt_series::kBothHalves)
    volumes_of_models.emplace_back(paths_of(run, half).model, paths_of(run, half).volume);
  if (options.voxel_type == VoxelType::kInt16) {
    float largest = 0.0f;
    for (const auto& [model, volume] : volumes_of_models)
      largest = std::max(largest, output::largest_density(output::load_model(model)));
    part.largest_density = largest;
  }
  for (const auto& [model, volume] : volumes_of_models) {
    output::write_volume(output::load_model(model), options, volume, part);
    options.zarr = false;  // of the volume of all data alone
  }
}

// Makes one linear volume after the other, too, and so twice if they share a factor.
void write_linear_volumes(const Run& run) {
  std::optional<float> largest;
  if (run.options.volume.voxel_type == VoxelType::kInt16) {
    largest = 0.0f;
    for (const Half half : tilt_series::kBothHalves) {
      const measurement::Measurement measured = half_measurement(half, run);
      largest = std::max(*largest, baseline::LinearVolume(measured, run.options).largest_density());
    }
  }
  for (const Half half : tilt_series::kBothHalves) {
    const measurement::Measurement measured = half_measurement(half, run);
    baseline::LinearVolume(measured, run.options).write(paths_of(run, half).linear_volume, largest);
  }
}

// Writes the volumes and the maps, and measures how they agree.
Agreement write_maps(const Run& run, const io::OutputSet& outputs) {
  write_volumes(run);
  const std::filesystem::path even = outputs.location_of(paths_of(run, Half::kEven).volume);
  const std::filesystem::path odd = outputs.location_of(paths_of(run, Half::kOdd).volume);
  const evaluate::TiltRange tilts = tilt_range(run);
  evaluate::write_uncertainty(even, odd, run.paths.uncertainty);
  Agreement found{.fsc = evaluate::correlate_blocks(even, odd, tilts),
                  .linear_fsc = {},
                  .local = evaluate::local_resolution(even, odd, tilts)};
  evaluate::write_local_resolution(found.local, even, run.paths.local_resolution);
  if (run.options.fit.denoising_halves) {
    write_linear_volumes(run);
    found.linear_fsc = evaluate::correlate_blocks(
        outputs.location_of(paths_of(run, Half::kEven).linear_volume),
        outputs.location_of(paths_of(run, Half::kOdd).linear_volume), tilts);
  }
  return found;
}

void write_fsc_plot(const Agreement& found, const std::filesystem::path& path) {
  const auto curve = [](const char* name, const evaluate::Fsc& fsc, const evaluate::FscCurve& of) {
    return report::fsc_curve(name, fsc.frequency_per_A, of.correlation);
  };
  const evaluate::Fsc& fsc = found.fsc;
  std::vector<report::Curve> curves{curve("fitted halves", fsc, fsc.all),
                                    curve("fitted halves, measured", fsc, *fsc.measured),
                                    curve("fitted halves, missing wedge", fsc, *fsc.missing)};
  if (found.linear_fsc)
    curves.push_back(
        curve("linear halves, measured", *found.linear_fsc, *found.linear_fsc->measured));
  report::write_curve_plot(report::fsc_axes(fsc.frequency_per_A.back()), curves, path);
}

record::HalvesRecord halves_record(const Run& run, const FinishedFits& fits,
                                   const Agreement& found) {
  const auto of_half = [&](Half half) {
    return record::HalvesRecord::OfHalf{paths_of(run, half).volume, paths_of(run, half).model,
                                        fits.halves[static_cast<std::size_t>(half)]};
  };
  const auto fsc_of = [&](const evaluate::Fsc& fsc,
                          std::filesystem::path output::OutputPaths::OfHalf::*volume) {
    return record::FscRecord{fsc,
                             {.first = paths_of(run, Half::kEven).*volume,
                              .second = paths_of(run, Half::kOdd).*volume,
                              .mask = {},
                              .box = {},
                              .tilts = tilt_range(run)}};
  };
  using OfHalf = output::OutputPaths::OfHalf;
  const double voxel_A = run.measurement.pixel_size_A;
  record::HalvesRecord record{.are_of_tilts = run.options.fit.split_tilts,
                              .halves = {of_half(Half::kEven), of_half(Half::kOdd)},
                              .fsc = fsc_of(found.fsc, &OfHalf::volume),
                              .linear = {},
                              .local_resolution = run.paths.local_resolution,
                              .uncertainty = run.paths.uncertainty,
                              .median_A = voxel_A * found.local.percentile_px(50),
                              .finest_tenth_A = voxel_A * found.local.percentile_px(10),
                              .coarsest_tenth_A = voxel_A * found.local.percentile_px(90)};
  if (found.linear_fsc) record.linear = fsc_of(*found.linear_fsc, &OfHalf::linear_volume);
  return record;
}

std::string crossing_text(const evaluate::Fsc& fsc, double threshold) {
  const auto at = evaluate::crossing_A(fsc.frequency_per_A, fsc.all, threshold);
  if (at) return fmt::format("at {:.4g} Å", *at);
  return evaluate::starts_below(fsc.all, threshold) ? "from the first shell on" : "nowhere";
}

// Says what the halves are for and what they are not.
void log_halves(const Run& run, const evaluate::Fsc& fsc) {
  base::log_info(fmt::format(
      "the FSC of the halves falls below 0.5 {} and below 0.143 {}; it is too optimistic, because "
      "the errors of two regularised fits are alike",
      crossing_text(fsc, 0.5), crossing_text(fsc, 0.143)));
  const output::OutputPaths::OfHalf &even = paths_of(run, Half::kEven),
                                    &odd = paths_of(run, Half::kOdd);
  base::log_warning(fmt::format(
      "'{}' and '{}' are regularised: do not train cryoCARE, IsoNet or DeepDeWedge with them; {}",
      even.volume.string(), odd.volume.string(),
      run.options.fit.denoising_halves
          ? fmt::format("take '{}' and '{}'", even.linear_volume.string(),
                        odd.linear_volume.string())
          : "--denoising-halves writes linear halves for that"));
}

// Throws the exception that is being handled, and says that the fits are not lost.
[[noreturn]] void say_that_models_are_kept(const Run& run) {
  throw_with(fmt::format(
      "; the finished fits are kept in '{}', '{}' and '{}': --resume writes the results without "
      "another fit",
      run.paths.model.string(), paths_of(run, Half::kEven).model.string(),
      paths_of(run, Half::kOdd).model.string()));
}

void write_all(const Run& run, const FinishedFits& fits, const std::optional<tune::TunedFit>& tuned,
               RunResult& results) {
  io::OutputSet outputs;
  const Agreement found = write_maps(run, outputs);
  write_fsc_plot(found, run.paths.fsc_picture);
  if (tuned) report::write_choice_plot(*tuned, run.paths.choice_picture);
  if (fits.held_out_view)
    report::write_held_out_picture(*fits.held_out_view, run.paths.held_out_picture);
  results.record.halves = halves_record(run, fits, found);
  record::write_record(run.paths.json, results.record);
  write_pages(run, outputs, results);
  remove_stale_files(run.options, outputs);
  outputs.commit();
  log_halves(run, found.fsc);
}

}  // namespace

RunResult write_half_results(const Run& run, const FinishedFits& fits,
                             const std::optional<tune::TunedFit>& tuned) {
  record::FitRecord whole = fits.whole;
  whole.verdict.seconds = fits.halves.back().verdict.seconds;  // of all three fits
  whole.verdict.peak_GiB = fits.halves.back().verdict.peak_GiB;
  RunResult results{.model = {}, .record = run_record(run.options, std::move(whole))};
  run.processes.run_collectively([&] {
    if (!run.processes.is_root()) return;
    try {
      write_all(run, fits, tuned, results);
    } catch (const Error&) {
      say_that_models_are_kept(run);
    }
  });
  return results;
}

}  // namespace tomofield::reconstruction
