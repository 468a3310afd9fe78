#pragma once

#include <nlohmann/json.hpp>

#include "fit/fit.h"
#include "measurement/prepare.h"
#include "output/model_file.h"
#include "reconstruct/checkpoint.h"
#include "reconstruct/options.h"

namespace tomofield::reconstruction {

/// What the field of a fit means.
output::ModelInfo model_info(const measurement::Measurement& series,
                             const ReconstructOptions& options);

/// What a finished fit leaves.
struct Results {
  output::Model model;     ///< of several processes, each has the leaves that it worked on
  nlohmann::json metrics;  ///< what the JSON beside the volume says
};

/// Takes the results out of a finished fit, whose field is gone then. If options.resolved.output
/// names the volume, writes the volume, the model, the metrics, and of views that were held out a
/// picture. Every process calls it.
Results finish(fit::Fit& fit, const measurement::Measurement& series,
               const ReconstructOptions& options, const FitOrigin& origin, double seconds);

}  // namespace tomofield::reconstruction
