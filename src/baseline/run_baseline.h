#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "baseline/method.h"
#include "io/images/image_stack.h"
#include "io/saving/output_lock.h"
#include "measurement/prepare.h"
#include "microscope/view_filter.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/options.h"
#include "tomofield/tomogram.h"

namespace tomofield::baseline {

/// The settings of a baseline reconstruction.
struct BaselineOptions {
  SeriesFiles files;
  /// The options that do not depend on the method: images, masks, contrast transfer and dose,
  /// specimen, margin_spacing, fit_view_scale, hold_out, tune (tune.h), volume, output and
  /// overwrite. Others have no effect.
  Options shared;
  Method method;
  /// Corrects the views before, if there is a contrast transfer.
  microscope::CtfCorrection ctf_correction = microscope::CtfCorrection::kFlip;

  /// Keeps densities at or above zero. Not given: settle() decides by the contrast.
  std::optional<bool> non_negative = {};

  /// Returns whether the scales of views are fitted, which the contrast decides unless it is given.
  bool fits_view_scale() const;
  std::shared_ptr<const io::ImageStack> images = {};  ///< views in memory, in place of files.stack

  /// Returns how the tilt series is read.
  tilt_series::TiltSeriesOptions input() const;
};

/// Gives the method what the contrast decides unless it is given: whether densities stay at or
/// above zero. Call it before the functions below.
void settle(BaselineOptions& options);

/// Checks the options and the output files. Throws Error for options out of range, and if results
/// would replace existing ones without `overwrite` or cannot be written. Without an output there
/// are no files.
void check_options(const BaselineOptions& options);

/// Checks the options and locks the files of a run against other runs. The run holds the locks to
/// its end. Throws Error as check_options() does, or if another run writes these files.
std::vector<io::OutputLock> claim_outputs(const BaselineOptions& options);

/// The plan of a run. Making it allocates and writes nothing.
struct BaselinePlan {
  int num_views = 0;
  geometry::TiltGeometry geometry;
  Rectangle roi;
  double pixel_size_A = 0;
  std::size_t num_voxels = 0;      ///< with the margins
  std::size_t num_parameters = 0;  ///< fitted ones: the voxels, or a network's parameters
  std::size_t memory_bytes = 0;    ///< estimated peak
};

/// Plans a run. Throws Error for options that do not fit the series, and if the machine has less
/// memory than the run needs.
BaselinePlan plan_baseline(const tilt_series::PlannedSeries& series,
                           const BaselineOptions& options);

/// The results of a run that the program prints, or that stay in memory.
struct BaselineSummary {
  double mean_squared_residual = 0;     ///< in units of the noise's variance
  std::optional<double> last_decrease;  ///< last_decrease(), for iterative methods
  tilt_series::BeadMasking bead_masking = tilt_series::BeadMasking::kNone;
  std::string record = {};                ///< the content of the JSON file: options and metrics
  std::optional<Tomogram> tomogram = {};  ///< of a run without an output
};

/// The receivers of the progress of a run.
struct BaselineProgress {
  base::ProgressSink tuning, reconstruction;
};

/// Reads the series, tunes if the options ask for it, reconstructs, and writes the volume (MRC, in
/// the input's units and contrast), the metrics and resolved options (JSON) and the pictures, all
/// together. Without an output it returns the volume and writes nothing. Starts at once: call
/// check_options() and plan_baseline() first. An exception of `progress` ends it.
BaselineSummary run_baseline(const tilt_series::TiltSeries& series, const BaselineOptions& options,
                             const BaselineProgress& progress);

/// The weighted back-projection of a prepared measurement, without held-out and left-out views and
/// without scales of views, so that it is linear in the rays.
class LinearVolume {
 public:
  /// Reconstructs it. `shared` has the options of the specimen and of the volume. `series` must
  /// live as long.
  LinearVolume(const measurement::Measurement& series, const Options& shared);

  float largest_density() const;
  /// Writes the volume alone, as run_baseline() does. `largest_density` is that of VolumePart.
  void write(const std::filesystem::path& path, std::optional<float> largest_density) const;

 private:
  const measurement::Measurement& series_;
  BaselineOptions options_;
  Solution solution_;
};

}  // namespace tomofield::baseline
