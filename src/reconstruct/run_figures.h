#pragma once

#include <nlohmann/json.hpp>

#include "reconstruct/fit.h"
#include "reconstruct/prepare.h"

namespace tomofield::reconstruct {

/// What a fit that took so many seconds amounts to, for the JSON beside the volume.
nlohmann::json figures_json(const Fit& fit, const PreparedSeries& series, double seconds);

/// What each process did in the steps of this run. Every process calls it.
nlohmann::json processes_json(const Fit& fit, double seconds);

}  // namespace tomofield::reconstruct
