#pragma once

#include <optional>
#include <string>

#include "io/images/image_stack.h"
#include "io/tables/alignment_files.h"
#include "tilt_series/series_plan.h"

namespace tomofield::tilt_series {

/// Returns the axis that the header of a stack states: SerialEM's title among its labels, else its
/// extended header. A stack that a program has transformed states none.
std::optional<StatedAxis> axis_of_header(const io::ImageStack& stack);

/// Returns the axis by the first of: --tilt-axis, the .mdoc, SerialEM's title among the labels of
/// the stack, the stack's extended header. The labels of a stack that a program has transformed
/// (newstack with an .xf file, blendmont) tell of the raw one, and so does its extended header:
/// neither counts. Files do not count if --ignore names TiltAxisAngle. Throws Error for an .mdoc of
/// Tomography from which the axis cannot be told, unless `is_aligned`: the axis is then not needed.
std::optional<StatedAxis> find_stated_axis(const TiltSeriesOptions& options,
                                           const io::ImageStack& stack,
                                           const std::optional<io::Mdoc>& mdoc, bool is_aligned);

/// Returns by how much two directions of an axis differ, in degrees from 0 to 180. Opposite ones
/// are of volumes that are mirrored in z.
double angle_between_axes(double a_deg, double b_deg);

/// Returns the axis that a lone RotationAngle of an .mdoc belongs to by the rule of SerialEM, which
/// does not tell it from its opposite. Returns nothing if the .mdoc states an axis, or no such
/// angle, or if --ignore names TiltAxisAngle.
std::optional<StatedAxis> axis_of_lone_rotation(const TiltSeriesOptions& options,
                                                const io::Mdoc& mdoc);

/// Throws Error for a stack that is taken for an aligned one although its axis is not vertical.
void require_vertical(const StatedAxis& axis, const io::ImageStack& stack);

}  // namespace tomofield::tilt_series
