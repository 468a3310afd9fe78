#pragma once

#include "field/model_file.h"
#include "reconstruct/checkpoint.h"
#include "reconstruct/fit.h"
#include "reconstruct/prepare.h"
#include "reconstruct/run_options.h"

namespace tomofield::reconstruct {

/// What the field of a fit means.
field::ModelInfo model_info(const PreparedSeries& series, const ReconstructOptions& options);

/// Writes what a finished fit leaves: model, volume, figures, and of views that were held out a
/// picture. The fit's field is gone then. Every process calls it.
void write_results(Fit& fit, const PreparedSeries& series, const ReconstructOptions& options,
                   const FitOrigin& origin, const OutputPaths& paths, double seconds);

}  // namespace tomofield::reconstruct
