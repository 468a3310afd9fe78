#pragma once

#include <optional>

#include "fit/fit.h"
#include "measurement/measurement.h"
#include "verdict/ring_check.h"

namespace tomofield::verdict {

/// The signs that views have another defocus than the one that they were fitted with. Where it is
/// wrong, the residual of a view has rings in its spectrum: it resembles the change of the filtered
/// prediction with the defocus.
struct DefocusCheck {
  /// True defocus over the given one, less 1: the median of the views, and its standard error by
  /// their scatter.
  double error = 0.0, standard_error = 0.0;
  /// Part of the residuals' squares that such a change explains, in the median view.
  double rings = 0.0;

  /// The change of the defocus across tilted views, as the residuals show it.
  struct Slope {
    double error = 0.0, standard_error = 0.0;
  };
  /// True slope over the given one, less 1: about 0 for the right hand, and towards −2 for the
  /// wrong one. None if few views are tilted.
  std::optional<Slope> slope = {};

  std::optional<RingCheck> spectra = {};  ///< what the views say without a field; none of few views
};

/// Checks up to 16 views, evenly spaced in order of tilt. Returns nothing if the views have no
/// contrast transfer, or none of them tells its defocus. The field was fitted with the given
/// defocus and follows it, so that the error that is found is rather too small. Every process calls
/// it and gets the same. The fit must be at full resolution.
std::optional<DefocusCheck> check_defocus(const fit::Fit& fit,
                                          const measurement::Measurement& series);

}  // namespace tomofield::verdict
