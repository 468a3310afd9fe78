#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "field/field.h"

namespace tomofield::field {

/// The vertex values of a field of kind "grid" as vector–matrix factors (eq. 4) on the same tree,
/// one shape a leaf with the same vertices and the ranks to have. Along x and along y the leading
/// singular vectors of the unfolded leaf (De Lathauwer, De Moor and Vandewalle 2000) take what
/// they can, half of what both can each; the best approximation of the rest (Eckart and Young 1936)
/// goes to the vectors along z. Exact where a rank is as high as the vertices of its axis; ranks
/// with nothing left to hold are zero for good. A vector and its matrix have the same root mean
/// square, so that one learning rate suits both.
std::unique_ptr<Field> factorised(const Field& vertices, std::vector<LeafShape> shapes);

/// Bytes that a thread works in while it factorises a leaf.
std::size_t factorising_memory(const LeafShape& shape);

}  // namespace tomofield::field
