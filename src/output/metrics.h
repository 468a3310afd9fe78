#pragma once

#include <nlohmann/json.hpp>

#include "compact/compress.h"
#include "fit/fit.h"
#include "measurement/prepare.h"

namespace tomofield::output {

/// Returns the metrics of the masks as JSON, for every command that reconstructs: beads, hot and
/// dead pixels, and the fraction of rays without a loss, of all rays and by view. Views are in the
/// stack's order.
nlohmann::json mask_json(const measurement::Measurement& series);

/// Returns the metrics of a fit as JSON, for the file beside the volume. `seconds` is the fit's
/// time.
nlohmann::json metrics_json(const fit::Fit& fit, const measurement::Measurement& series,
                            double seconds);

/// Returns the metrics of a compact model, whose compression took `seconds`.
nlohmann::json compact_json(const compact::CompressionReport& report, double seconds);

/// Returns as JSON the work and the times of each process in the steps of this run. Every process
/// calls it.
nlohmann::json processes_json(const fit::Fit& fit, double seconds);

}  // namespace tomofield::output
