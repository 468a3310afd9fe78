#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "field/field.h"

namespace tomofield::compact {

/// The modes of a leaf (truncation.h) as whole numbers. A step stands for the same error of the
/// densities in every one of them: entries of a matrix M are counted in steps; its vector, which
/// has length 1, in steps over the length of M. So one step size serves a whole file.
///
/// The order of the numbers is VX, MYZ, VY, MXZ, VZ, MXY, each component by component, which is
/// that of a leaf of factors (field/vm/vm_field.h) but for the components, which are innermost
/// there.
struct QuantisedLeaf {
  field::LeafShape shape;
  std::vector<std::int32_t> numbers;
};

/// Writes the parameters of a leaf of factors (field::FieldKind::kVm). `parameters` has as many as
/// the shape says.
void dequantise(const QuantisedLeaf& leaf, double step, std::span<float> parameters);

/// Packs the numbers: numbers of seven bits a byte, the sign first (zigzag), by LZMA2 without a
/// header, and a checksum. A leaf without numbers takes no bytes. LZMA adapts to the sizes of the
/// numbers of one component after the other, which a code with one table a leaf does not.
std::vector<std::uint8_t> encode(const QuantisedLeaf& leaf);

/// Unpacks the numbers of a leaf of this shape. Throws Error if the code is damaged or has another
/// number of them. It takes memory in proportion to the shape alone, whatever the code says.
QuantisedLeaf decode(std::span<const std::uint8_t> code, const field::LeafShape& shape);

}  // namespace tomofield::compact
