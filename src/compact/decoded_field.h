#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "compact/leaf_code.h"
#include "field/field.h"

namespace tomofield::compact {

/// The codes of all leaves (leaf_code.h), one after the other. A leaf has its lower faces alone:
/// its upper faces are the lower ones of its neighbours, so nothing is stored twice.
struct LeafCodes {
  double step = 0.0;  ///< of the densities' whole numbers
  /// Neighbouring vertices of two leaves, d apart in density, move towards each other by this times
  /// d. It makes up for errors of the leaves, which know nothing of each other.
  double face_weight = 0.0;
  std::vector<field::LeafShape> shapes;  ///< a leaf's vertices but those of its upper faces
  std::vector<std::int64_t> offset;      ///< [leaf + 1] index in `bytes` of a leaf's first byte
  std::vector<std::uint8_t> bytes;

  /// Returns how many numbers the codes stand for.
  std::size_t num_parameters() const;
  std::span<const std::uint8_t> code(int leaf) const;
};

/// Stands for a leaf where the field that was compressed has none.
inline constexpr field::LeafShape kNoLeaf{.nx = 1, .ny = 1, .nz = 2};

/// Returns the shape of a leaf with its upper faces.
field::LeafShape with_upper_faces(const field::LeafShape& shape);

/// Returns the field of plain vertices (field::FieldKind::kGrid) that the codes stand for:
/// densities without an activation. A vertex on an upper face gets the density of the leaf that
/// begins there, interpolated between that leaf's own vertices if these are elsewhere; at the end
/// of the field, that of the nearest vertex. Throws Error if a code is damaged.
std::unique_ptr<field::Field> decode_field(field::Quadtree tree, double thickness,
                                           const LeafCodes& codes);

/// Returns the weight with which neighbouring vertices across the faces of leaves differ as much,
/// against neighbours in the middle of leaves, as they do in `original`. `decoded` is what the
/// codes stand for with a weight of 0.
double matching_face_weight(const field::Field& decoded, const LeafCodes& codes,
                            const field::Field& original);

}  // namespace tomofield::compact
