#pragma once

#include <optional>
#include <vector>

#include "evaluate/image_pair.h"

namespace tomofield::reconstruction {

/// How much a measured view is sheared against its prediction: what lies at (x, y) from the centre
/// of the predicted view lies at (x + shear y, y + shear x) of the measured one. `weight` is the
/// sum of squares that a shear of 1 explains and nothing else does that moves, turns or stretches
/// the view. It is 0 for a view without contrast.
struct ViewShear {
  double shear = 0.0, weight = 0.0;
};

/// Returns the shear of a view by least squares, for displacements of a pixel or two. Both images
/// have one size.
ViewShear shear_of(const evaluate::Image& measured, const evaluate::Image& predicted);

/// Tells by how much the tilt axis is turned against the y axis of the views. If it is turned by a
/// small angle ε, a view of tilt θ shows the point (X, Y, Z) at (c X + s Z − ε Y, Y + ε (c X + s
/// Z)), where c = cos θ and s = sin θ. A field that is turned by ε as well shows it at (c (X − ε Y)
/// + s Z, Y + ε X). The difference is a shear of −ε (1 − c), which no field takes away from all
/// views.
struct AxisError {
  double angle_deg = 0.0;  ///< ε, counter-clockwise from the y axis
  double standard_error_deg = 0.0;
};

/// Fits ε cos θ and a constant, which the field is free to take, to the shears of views by weighted
/// least squares. The standard error is that of the scatter. The field follows a wrong axis in
/// part, so that the angle is rather too small. Returns nothing for fewer than eight views that
/// tell their shear, or for views of one tilt.
std::optional<AxisError> axis_error(const std::vector<ViewShear>& views,
                                    const std::vector<double>& tilt_deg);

}  // namespace tomofield::reconstruction
