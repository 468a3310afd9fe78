#pragma once

#include <vector>

#include "field/field.h"
#include "tomofield/options.h"

namespace tomofield::field {

/// Returns the densities of a region at half the thickness, one value a pixel: [y, x].
std::vector<float> middle_plane(const Field& field, const Rectangle& region);

}  // namespace tomofield::field
