#pragma once

#include "compact/vertex_densities.h"

namespace tomofield::compact {

/// One mode of the vector–matrix form (TensoRF, Chen et al. 2022): vectors along one axis, times
/// matrices over the other two. The columns of the vectors are orthonormal.
struct Mode {
  FloatMatrix vectors;  ///< [n, rank]
  FloatMatrix
      matrices;  ///< [product of the two other axes in the order x, z, y (z mode: x, y), rank]
  Eigen::Index rank() const { return vectors.cols(); }
  std::size_t num_parameters() const {
    return static_cast<std::size_t>(vectors.size() + matrices.size());
  }
};

/// The densities of a square as three modes, whose sum they are.
struct Truncation {
  Mode x, y, z;
  double square_error = 0.0;  ///< summed over the vertices

  std::size_t num_parameters() const {
    return x.num_parameters() + y.num_parameters() + z.num_parameters();
  }
};

/// Finds modes for the densities of a square that minimise
///
///   square error + price · number of parameters
///
/// by alternating least squares: each mode in turn becomes the leading singular vectors of what the
/// two others leave, as many as pay for their parameters (Eckart and Young 1936). No step increases
/// the sum. It begins with the z mode, which serves thick specimens best. The ranks follow from the
/// price.
Truncation truncate(const PlaceDensities& place, double price);

/// Returns the energy of each component of the z mode alone, in any order.
Eigen::VectorXf energies_of_sections(const PlaceDensities& place);

/// Returns the values of modes, [nx, nz·ny].
FloatMatrix values_of(const Truncation& modes, int nx, int ny, int nz);

}  // namespace tomofield::compact
