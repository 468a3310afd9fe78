#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fit/fit.h"
#include "fit/stages.h"
#include "fit/tree_updates.h"
#include "measurement/measurement.h"
#include "measurement/view_residuals.h"
#include "output/metrics_record.h"

namespace tomofield::record {

/// Describes a view as a fit found it. Offset and noise are in the units of the stack.
struct ViewMetrics {
  double tilt_deg = 0.0;
  double scale = 0.0, offset = 0.0;
  double noise_sigma = 0.0;
  std::optional<double> residual;  ///< of the last epoch; none for a view that was not fitted
  double weight = 0.0;             ///< 1 for a view that is explained as well as its noise allows
};

/// The work of a process in the steps of a fit, and its times.
struct ProcessMetrics {
  std::int64_t bands = 0, rows = 0, leaves = 0;
  double seconds_computing = 0.0, seconds_communicating = 0.0;
  double bytes_sent_per_step = 0.0;
};

/// The error of views that were held out.
struct HeldOutMetrics {
  measurement::ViewErrors errors;
  bool has_stopped_fit = false;        ///< the same views decided when the fit stopped
  std::vector<double> error_by_epoch;  ///< if the epochs were scored
};

/// Collects what is measured on a finished fit.
struct FitMetrics {
  std::size_t num_parameters = 0;
  std::int64_t num_leaves = 0;
  std::vector<fit::TreeUpdate> tree_updates;
  std::int64_t steps = 0;
  std::vector<double> data_loss;  ///< [epoch]: mean squared residual over the noise variance
  double density_unit = 0.0;
  double tv_gain = 0.0, tv_weight = 0.0;
  double pixel_size_A = 0.0;
  std::int64_t width = 0, height = 0;  ///< of the region
  double thickness = 0.0;
  std::vector<fit::Stage> stages;
  double seconds = 0.0;  ///< of the steps
  int threads = 0;
  std::string threads_why;
  output::MaskedViews mask;
  std::vector<ViewMetrics> views;
  std::optional<HeldOutMetrics> held_out;
  std::vector<ProcessMetrics> processes;
};

/// Measures a fit to `series` whose steps took `seconds`, with `tv_weight` as its weight of total
/// variation. Held-out views are not scored. Every process calls it.
FitMetrics fit_metrics(const fit::Fit& fit, const measurement::Measurement& series,
                       double tv_weight, double seconds);

}  // namespace tomofield::record
