#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "io/images/mrc.h"

namespace tomofield::report {

/// The values that are black and white where a volume is shown at first. All pictures and pages
/// choose them by the same rule, from the specimen and not from what lies around it.
struct Contrast {
  double black = 0.0, white = 1.0;
};

/// Returns the size of the middle of a volume, in voxels: half of its shortest axis, which is that
/// of the thickness, and three quarters of the other two. Faces and edges, to which tilted views
/// have not all contributed, lie outside.
std::array<std::int64_t, 3> middle_size(const std::array<std::int64_t, 3>& size);

/// Returns the 0.5 and 99.5 percentiles of the finite values among `values`, each at most three
/// times as far from the median as the 2 or 98 percentile: a few gold beads do not take the greys
/// of the rest. White is always above black.
Contrast contrast_of(std::vector<float> values);

/// Chooses the contrast of an MRC volume by its middle: up to 32 of its sections, at most four
/// million voxels.
Contrast contrast_of(const io::MrcReader& volume);

}  // namespace tomofield::report
