#pragma once

#include <span>
#include <vector>

#include "compact/coded_field.h"
#include "field/sampling/sample_box.h"

namespace tomofield::compact {

/// Computes the densities of a box of a coded field, as field::sample_box() does for the field that
/// decode_field() returns. Some bands are decoded at a time, so it takes the memory of few bands. A
/// box whose rows reach across the bands takes that of all bands which it reaches. Nothing that was
/// decoded is kept.
void sample_box(const CodedField& coded, const field::OrientedBox& box, const field::BoxSink& sink);
/// Does the same and returns them in the order [z, y, x].
std::vector<float> sample_box(const CodedField& coded, const field::OrientedBox& box);

/// Returns the densities at points, as field::sample_points() does for the field that
/// decode_field() returns. The bands around each row of root cells that has points are decoded
/// for it.
std::vector<float> sample_points(const CodedField& coded, std::span<const field::Point> points);

}  // namespace tomofield::compact
