#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "compact/compress.h"
#include "measurement/measurement.h"
#include "measurement/view_residuals.h"
#include "tilt_series/masks/mask_metrics.h"

// Metrics that the records of several commands have.
namespace tomofield::output {

/// Tells what is masked in the views of a measurement.
struct MaskedViews {
  tilt_series::MaskMetrics masks;
  std::vector<double> tilt_deg;  ///< [view], in the stack's order
  std::vector<double> part;      ///< [view]: the fraction of the rays that have no loss
  double mean_part() const;
};
MaskedViews masked_views(const measurement::Measurement& series);

/// Returns the metrics of the masks: beads, hot and dead pixels, and the fraction of rays without a
/// loss, of all rays and by view.
nlohmann::json mask_json(const MaskedViews& masked);

/// Logs the error of held-out views. With `stopped_by_them` the same views decided when the fit
/// stopped, and the log says so.
void log_held_out(const measurement::ViewErrors& error, bool stopped_by_them = false);

/// Returns that error and the one of each view. `tilt_deg` are the tilts of all views.
nlohmann::json held_out_json(const measurement::ViewErrors& error,
                             const std::vector<double>& tilt_deg, bool stopped_by_them = false);

/// Returns the metrics of a compact model, whose compression took `seconds`.
nlohmann::json compact_json(const compact::CompressionReport& report, double seconds);

}  // namespace tomofield::output
