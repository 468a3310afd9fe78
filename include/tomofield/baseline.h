#pragma once

#include <tomofield/reconstruct.h>
#include <tomofield/tomogram.h>

#include <string>

namespace tomofield {

/// Other methods, to compare with: weighted back-projection, simultaneous iterative reconstruction,
/// ordered subsets with total variation, and least squares with total variation.
enum class BaselineMethod { kWbp, kSirt, kSartTv, kTv };

/// The results of reconstruct_baseline().
struct Baseline {
  bool is_finished = false;  ///< false: the callback stopped it, and the rest is empty
  Tomogram tomogram;         ///< in the units and the contrast of the views
  std::string metrics;       ///< JSON: what `tomofield baseline` writes beside the volume
};

/// Reconstructs by another method, as `tomofield baseline` does with the defaults of that method,
/// and writes nothing. Of `options`, those of the views and of the specimen count,
/// FieldOptions::with_margin and margin_spacing, FitOptions::fit_view_scale, hold_out and tune, and
/// VolumeOptions::invert. A contrast transfer is corrected before, by flipping phases.
///
/// It takes its turn with reconstruct(). Throws Error as that does, and if RunOptions::output is
/// given.
Baseline reconstruct_baseline(const TiltSeries& series, BaselineMethod method,
                              const Options& options, const ProgressCallback& progress = {});

}  // namespace tomofield
