#pragma once

#include <nlohmann/json.hpp>

#include "compact/compress.h"
#include "fit/fit.h"
#include "measurement/held_out.h"
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

/// Logs the error of held-out views; returns it and that of each view. With `stopped_by_them` the
/// same views decided when the fit stopped, and both say so.
nlohmann::json report_held_out(const measurement::ViewErrors& error,
                               const std::vector<double>& tilt_deg, bool stopped_by_them = false);

/// Returns the metrics of a compact model, whose compression took `seconds`.
nlohmann::json compact_json(const compact::CompressionReport& report, double seconds);

/// Returns as JSON the work and the times of each process in the steps of this run. Every process
/// calls it.
nlohmann::json processes_json(const fit::Fit& fit, double seconds);

}  // namespace tomofield::output
