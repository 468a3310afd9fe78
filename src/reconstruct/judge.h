#pragma once

#include <optional>

#include "base/range.h"
#include "fit/fit.h"
#include "measurement/measurement.h"
#include "reconstruct/options.h"
#include "reconstruct/run_record.h"
#include "reconstruct/verdict.h"

namespace tomofield::reconstruction {

/// A finished fit and where it comes from.
struct FinishedFit {
  const fit::Fit& fit;
  const measurement::Measurement& series;
  const ReconstructOptions& options;
  const RunRecord& record;
  base::Range rows;  ///< rows of the volume that this process works on
};

/// Judges a finished fit: measures what its field and its views show, and finds what is off.
/// `held_out` are the errors of the held-out views, if there are any. Every process calls it.
Verdict judge(const FinishedFit& finished, const std::optional<measurement::ViewErrors>& held_out);

}  // namespace tomofield::reconstruction
