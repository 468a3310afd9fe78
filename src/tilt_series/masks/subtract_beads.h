#pragma once

#include <vector>

#include "microscope/view_transfer.h"
#include "tilt_series/image.h"
#include "tilt_series/masks/mask_metrics.h"

namespace tomofield::tilt_series {

/// Subtracts from a view of line integrals what its contrast transfer makes of gold beads, with the
/// fringes around them. A bead is a solid sphere, about `diameter_px` wide and about at the middle
/// of its disc. Its density, radius and place are fitted by least squares to the pixels around it,
/// with a constant background. The pixels of all beads themselves have no say, since gold is no
/// weak object and its middle may be saturated. Densities of a view are drawn to their mean as if
/// they had a spread of 30 percent, and radii and places to where they began, so that a bead that
/// is cut by the border gets about the fringes of the others.
///
/// Returns discs to mask. They hide what is left of the beads, and are narrower than `discs`, which
/// hide the fringes as well. They are `discs`, and nothing is subtracted, if the mean density is
/// not positive.
std::vector<MaskDisc> subtract_beads(const std::vector<MaskDisc>& discs, double diameter_px,
                                     const microscope::ViewTransfer& transfer, MaskedImage* image);

}  // namespace tomofield::tilt_series
