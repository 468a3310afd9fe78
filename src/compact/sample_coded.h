#pragma once

#include "compact/coded_field.h"
#include "field/sampling/sample_box.h"

namespace tomofield::compact {

/// Computes the densities of a box of a coded field, as field::sample_box() does for the field that
/// decode_field() returns. Some bands are decoded at a time, so it takes the memory of few bands. A
/// rotated box takes that of all bands which it reaches.
void sample_box(const CodedField& coded, const field::OrientedBox& box, const field::BoxSink& sink);

}  // namespace tomofield::compact
