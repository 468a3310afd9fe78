#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "fit/fit.h"
#include "measurement/measurement.h"
#include "verdict/axis_check.h"

namespace tomofield::verdict {

/// The change of the brightness of the views with the length of their rays in the volume.
struct PathEffect {
  double correlation = 0.0;
  /// Line through the means of all columns: its rise from the shortest to the longest ray, over the
  /// contrast of a view. It is positive for a specimen that is denser than what is around it.
  double rise = 0.0;
};

/// The agreement of some views of a series with the field that was fitted to them, and with each
/// other.
struct ViewAgreement {
  std::vector<int> views;           ///< those that were looked at, in order of tilt
  std::vector<double> correlation;  ///< [i]: of measured and predicted view
  /// [i]: how far the measured view lies from the predicted one, in pixels of the fit along x and
  /// y. It is 0 for a view that is aligned with the others.
  std::vector<std::array<double, 2>> displacement_px;
  /// Correlation of what the field leaves of a view between pixels that are neighbours along x and
  /// along y: the median of the views. It is about 0 for white noise.
  std::array<double, 2> residual_correlation{};
  /// The same of pixels that are four pixels apart, which noise that was interpolated does not
  /// reach: what the field cannot explain of the specimen does.
  std::array<double, 2> far_correlation{};
  /// Probability that two views that are neighbours in tilt are more alike than two that are not:
  /// near 1 for the angles of the views, near ½ for shuffled ones. Views may lie up to a sixteenth
  /// of their longer side off in x and y. None if there are few views, or if no two of them are
  /// more alike than noise is.
  std::optional<double> tilt_order;
  PathEffect path;
  std::optional<AxisCheck> axis;  ///< none if few views are far enough apart
  double side_px = 0.0;           ///< longest side of a view, in pixels of the fit

  /// Return the displacement that 9 of 10 views stay below, in any direction and along y alone.
  double usual_displacement_px() const;
  double usual_displacement_y_px() const;
};

/// Returns up to 16 views, nearly evenly spaced in order of tilt, and how many of them may be in
/// memory together.
std::vector<int> views_to_compare(const std::vector<double>& tilt_deg);
std::size_t views_at_once(const measurement::Measurement& series);

/// Predicts views_to_compare() and compares them with the measured ones. `has_margin` says that the
/// specimen continues outside the volume. Every process calls it and gets the same. The series must
/// be resampled, and the fit must be at full resolution.
ViewAgreement compare_views(const fit::Fit& fit, const measurement::Measurement& series,
                            bool has_margin);

}  // namespace tomofield::verdict
