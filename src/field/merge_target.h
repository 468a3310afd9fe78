#pragma once

#include <Eigen/Dense>

#include "field/field.h"

namespace tomofield::field {

using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The least-squares problem of a leaf that replaces four,
///
///   min_a Σ_c ‖(P_cx ⊗ P_cy) a − T_c‖²
///
/// over the leaf's vertex values a. T_c are the vertex values of quarter c, and P_c interpolates
/// from the leaf's vertices to the quarter's. With the normal matrices Σ PᵀP = L Lᵀ of each axis,
/// the problem is min ‖(Lxᵀ ⊗ Lyᵀ) a − B‖² + constant, a plain Frobenius norm in the coordinates b
/// = (Lxᵀ ⊗ Lyᵀ) a. Values and coordinates are [x, z, y], without the bias.
struct MergeTarget {
  Eigen::MatrixXd chol_x, chol_y;  ///< Lx [nx, nx], Ly [ny, ny], lower triangles
  RowMajorMatrix b;                ///< B [nx, nz·ny]
};

/// Makes the target of four sibling leaves of the same shape, first_leaf … first_leaf + 3.
MergeTarget make_merge_target(const Field& field, int first_leaf);

}  // namespace tomofield::field
