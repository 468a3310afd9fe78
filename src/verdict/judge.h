#pragma once

#include <optional>
#include <vector>

#include "base/range.h"
#include "fit/fit.h"
#include "geometry/raw_from_aligned.h"
#include "measurement/measurement.h"
#include "options/run_options.h"
#include "tune/trial_settings.h"
#include "verdict/verdict.h"

namespace tomofield::verdict {

/// A finished fit and where it comes from.
struct FinishedFit {
  const fit::Fit& fit;
  const measurement::Measurement& series;
  const options::ReconstructOptions& options;
  const std::optional<tune::TunedFit>& tuned;  ///< the trials that chose some of its options
  /// Where the pixels of each aligned view come from in the stack.
  const std::vector<geometry::RawFromAligned>& alignment;
  base::Range rows;  ///< rows of the volume that this process works on
};

/// Judges a finished fit: measures what its field and its views show, and finds what is off.
/// `held_out` are the errors of the held-out views, if there are any. Every process calls it.
Verdict judge(const FinishedFit& finished, const std::optional<measurement::ViewErrors>& held_out);

}  // namespace tomofield::verdict
