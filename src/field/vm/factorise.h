#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "field/field.h"

namespace tomofield::field {

/// Returns a field of kind "grid" as vector–matrix factors (eq. 4) on the same tree. `shapes` has
/// one shape a leaf, with the same vertices and the wanted ranks.
///
/// Along x and along y, the factors are the leading singular vectors of the unfolded leaf
/// (De Lathauwer, De Moor and Vandewalle 2000). What both axes can represent is divided equally
/// between them. The vectors along z receive the best approximation of the rest (Eckart and Young
/// 1936). The result is exact where a rank is as high as the number of vertices of its axis. Ranks
/// for which nothing is left are zero and stay so. A vector and its matrix have the same root mean
/// square, so that one learning rate suits both.
std::unique_ptr<Field> factorised(const Field& vertices, std::vector<LeafShape> shapes);

/// Returns the bytes that a thread needs to factorise a leaf.
std::size_t factorising_memory(const LeafShape& shape);

}  // namespace tomofield::field
