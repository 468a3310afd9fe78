#pragma once

#include <filesystem>
#include <optional>

#include "base/progress.h"
#include "baseline/method.h"
#include "measurement/prepare.h"
#include "output/volume.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::baseline {

/// Everything that a baseline reconstruction is made from.
struct BaselineOptions {
  tilt_series::TiltSeriesOptions input;
  measurement::SpecimenOptions specimen;
  double margin_spacing = 2.0;  ///< binned pixels between samples of the margins
  Method method;
  bool fit_view_scale = false;   ///< per-view scale and offset as nuisances
  int hold_out = 0;              ///< keep every so-manieth view from the fit; 0: none
  bool tune = false;             ///< choose settings by other views than these (tune.h)
  output::VolumeOptions volume;  ///< `box` stays empty: voxels are where they were fitted
  std::filesystem::path output;  ///< the volume; JSON and pictures lie beside it
  bool overwrite = false;
};

/// The files of a run, named after its volume.
struct BaselinePaths {
  std::filesystem::path volume, json, picture_prefix;
};
BaselinePaths baseline_paths(const std::filesystem::path& volume);

/// Throws Error if results would replace existing ones without `overwrite`, or
/// cannot be written where they shall go.
void check_outputs(const BaselineOptions& options);

/// What a run will do; nothing is allocated or written for it.
struct BaselinePlan {
  int num_views = 0;
  geometry::TiltGeometry geometry;
  geometry::Roi roi;
  double pixel_size_A = 0;
  std::size_t num_voxels = 0;      ///< with the margins
  std::size_t num_parameters = 0;  ///< that are fitted: the voxels, or a network's
  std::size_t memory_bytes = 0;    ///< estimated peak
};

/// Throws Error for options that do not fit the series, and when the memory
/// needed is beyond what the machine has.
BaselinePlan plan_baseline(const tilt_series::TiltSeries& series, const BaselineOptions& options);

/// What is left to say when it is done.
struct BaselineSummary {
  double mean_squared_residual = 0;     ///< in units of the noise's variance
  std::optional<double> last_decrease;  ///< see last_decrease(); of iterative methods
};

/// Where the progress of a run goes.
struct BaselineProgress {
  base::ProgressSink tuning, reconstruction;
};

/// Reads the series, tunes if it shall, reconstructs, writes the volume (MRC, the input's units and
/// contrast), and the figures and resolved options (JSON). Call check_outputs() and plan_baseline()
/// first: this starts at once.
BaselineSummary run_baseline(const tilt_series::TiltSeries& series, const BaselineOptions& options,
                             const BaselineProgress& progress);

}  // namespace tomofield::baseline
