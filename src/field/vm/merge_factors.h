#pragma once

#include "field/vm/merge_target.h"

namespace tomofield::field {

/// The six factors of a leaf in the coordinates of a MergeTarget: along x and y
/// they are Lᵀ times the factor.
struct LeafFactors {
  RowMajorMatrix vx;   ///< [nx, rank_x]
  RowMajorMatrix myz;  ///< [nz·ny, rank_x]
  RowMajorMatrix vy;   ///< [ny, rank_y]
  RowMajorMatrix mxz;  ///< [nx·nz, rank_y]
  RowMajorMatrix vz;   ///< [nz, rank_z]
  RowMajorMatrix mxy;  ///< [nx·ny, rank_z]
};

/// Alternating least squares over the six factors (Carroll and Chang 1970; Harshman
/// 1970), each step with a faint pull to where the factor is (proximal), so that it has one
/// solution where ranks exceed vertices: ‖B − Σ VX MYZ + VY MXZ + VZ MXY‖²
/// never grows. Ends when a sweep changes it by less than a thousandth. Returns
/// what is left of it.
double fit_factors(const RowMajorMatrix& b, LeafFactors& factors);

}  // namespace tomofield::field
