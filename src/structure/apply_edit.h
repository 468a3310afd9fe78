#pragma once

#include "field/field.h"
#include "optimize/adam.h"

namespace tomofield::structure {

/// Edits a field's tree between two steps; the optimiser's moments go along. A
/// quarter counts its leaf's steps, a merged leaf the fewest of its four (its
/// bias correction is then the most careful one).
void apply_edit(const field::QuadtreeEdit& edit, field::Field& field,
                optimize::Adam::State& optimizer);

}  // namespace tomofield::structure
