#pragma once

#include "fit/fit.h"
#include "measurement/prepare.h"
#include "output/model_file.h"
#include "reconstruct/checkpoint.h"
#include "reconstruct/options.h"

namespace tomofield::reconstruction {

/// What the field of a fit means.
output::ModelInfo model_info(const measurement::PreparedSeries& series,
                             const ReconstructOptions& options);

/// Writes what a finished fit leaves: model, volume, metrics, and of views that were held out a
/// picture. The fit's field is gone then. Every process calls it.
void write_results(fit::Fit& fit, const measurement::PreparedSeries& series,
                   const ReconstructOptions& options, const FitOrigin& origin,
                   const OutputPaths& paths, double seconds);

}  // namespace tomofield::reconstruction
