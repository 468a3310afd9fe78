#pragma once

#include <memory>

#include "compact/coded_field.h"
#include "field/field.h"
#include "tomofield/options.h"

namespace tomofield::compact {

/// Returns the field of plain vertices (field::FieldKind::kGrid) that the codes stand for:
/// densities without an activation. A vertex on an upper face gets the density of the leaf that
/// begins there, interpolated between that leaf's own vertices if these are elsewhere; at the end
/// of the field, that of the nearest vertex. Throws DamagedCode if a code is damaged or stands for
/// numbers that are no plausible densities.
std::unique_ptr<field::Field> decode_field(const CodedField& coded);

/// Throws DamagedCode where decode_field() does. Each thread holds one decoded leaf.
void require_sound(const CodedField& coded);

/// Returns the weight with which neighbouring vertices across the faces of leaves differ as much,
/// against neighbours in the middle of leaves, as they do in `original`. `decoded` is what the
/// codes stand for with weights of 0. Vertices outside the region of interest do not count.
double matching_face_weight(const field::Field& decoded, const LeafCodes& codes,
                            const field::Field& original, const Rectangle& roi);

}  // namespace tomofield::compact
