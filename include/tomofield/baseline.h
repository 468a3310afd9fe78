#pragma once

#include <tomofield/reconstruct.h>
#include <tomofield/tomogram.h>

#include <map>
#include <optional>
#include <string>

namespace tomofield {

/// Other methods, to compare with: weighted back-projection, simultaneous iterative reconstruction,
/// ordered subsets with total variation, least squares with total variation, a network with a hash
/// grid, and a network of plane waves.
enum class BaselineMethod { kWbp, kSirt, kSartTv, kTv, kIngp, kFourierNet };

/// The options that `tomofield baseline METHOD` has beside those of Options, as it takes them but
/// without dashes: {{"iterations", "80"}, {"ctf-correction", "wiener"}}.
using MethodOptions = std::map<std::string, std::string>;

/// The results of reconstruct_baseline().
struct Baseline {
  bool is_finished = false;  ///< false: the callback stopped it, and the rest is empty
  /// In the units and the contrast of the views. It is there only if RunOptions::output is empty.
  std::optional<Tomogram> tomogram;
  std::string metrics;  ///< JSON: what `tomofield baseline` writes beside the volume
};

/// Reconstructs by another method, as `tomofield baseline` does. Of `options`, those of the views,
/// of the specimen and of the volume count, FieldOptions::with_margin and margin_spacing,
/// FitOptions::fit_view_scale, hold_out and tune, and RunOptions::output and overwrite. With an
/// output it writes the files of the command line: the tomogram, the metrics (.json) and pictures.
/// Without one it writes nothing. A contrast transfer is corrected before, by flipping phases
/// unless `method_options` has another "ctf-correction".
///
/// It takes its turn with reconstruct(). Throws Error as that does, and for method options that the
/// method has not or that are out of range.
Baseline reconstruct_baseline(const TiltSeries& series, BaselineMethod method,
                              const Options& options, const MethodOptions& method_options = {},
                              const ProgressCallback& progress = {});

}  // namespace tomofield
