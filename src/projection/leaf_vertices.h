#pragma once

#include "field/field.h"
#include "kernels/ray_samples.h"

namespace tomofield::projection {

/// Returns a leaf's vertex counts as the ray kernels take them.
kernels::LeafVertices vertices_of(const field::LeafShape& shape);

/// Overwrites values[x, z, y] with the pre-activation at every vertex of a leaf, bias included. Its
/// trilinear interpolation is the leaf's pre-activation everywhere.
void contract_leaf(const field::Field& field, int leaf, float* values);

/// Applies the adjoint: adds dL/d parameters of the leaf to gradient[0 … count).
void contract_leaf_adjoint(const field::Field& field, int leaf, const float* grad_values,
                           float* gradient);

}  // namespace tomofield::projection
