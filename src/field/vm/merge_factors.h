#pragma once

#include "field/merge_target.h"

namespace tomofield::field {

/// The six factors of a leaf in the coordinates of a MergeTarget, which are Lᵀ times the factor
/// along x and y.
struct LeafFactors {
  RowMajorMatrix vx;   ///< [nx, rank_x]
  RowMajorMatrix myz;  ///< [nz·ny, rank_x]
  RowMajorMatrix vy;   ///< [ny, rank_y]
  RowMajorMatrix mxz;  ///< [nx·nz, rank_y]
  RowMajorMatrix vz;   ///< [nz, rank_z]
  RowMajorMatrix mxy;  ///< [nx·ny, rank_z]
};

/// Minimises ‖B − (Σ VX MYZ + VY MXZ + VZ MXY)‖² by alternating least squares over the six factors
/// (Carroll and Chang 1970; Harshman 1970), starting from `factors`. Each step is proximal: a faint
/// pull to the present factor makes its solution unique where ranks exceed vertices. The misfit
/// never grows. Ends when a sweep changes it by less than a thousandth. Returns the final misfit.
double fit_factors(const RowMajorMatrix& b, LeafFactors& factors);

/// Fits the parameters of a merged leaf of a vector–matrix field to its target. `parameters` hold
/// the start.
void merge_factors(const LeafShape& shape, const MergeTarget& target, float* parameters);

}  // namespace tomofield::field
