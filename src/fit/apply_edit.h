#pragma once

#include "field/field.h"
#include "fit/adam.h"

namespace tomofield::fit {

/// Edits a field's tree between two steps; the optimiser's moments go along. A
/// quarter counts its leaf's steps, a merged leaf the fewest of its four (its
/// bias correction is then the most careful one).
void apply_edit(const field::QuadtreeEdit& edit, field::Field& field, Adam::State& optimizer);

}  // namespace tomofield::fit
