#pragma once

#include <nlohmann/json.hpp>

#include "fit/fit.h"
#include "measurement/prepare.h"

namespace tomofield::output {

/// What a fit that took so many seconds amounts to, for the JSON beside the volume.
nlohmann::json figures_json(const fit::Fit& fit, const measurement::PreparedSeries& series,
                            double seconds);

/// What each process did in the steps of this run. Every process calls it.
nlohmann::json processes_json(const fit::Fit& fit, double seconds);

}  // namespace tomofield::output
