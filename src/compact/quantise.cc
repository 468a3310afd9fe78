#include "compact/quantise.h"

#include <algorithm>
#include <cmath>

namespace tomofield::compact {
namespace {

using Eigen::Index;

constexpr double kLargest = 1e9;  // number that a quantised value may have

std::int32_t rounded(double value) {
  return static_cast<std::int32_t>(std::lround(std::clamp(value, -kLargest, kLargest)));
}

// Appends the vectors and then the matrices of a mode. Returns the rank.
int append(const Mode& mode, double step, std::vector<std::int32_t>& numbers) {
  std::vector<Index> kept;
  for (Index r = 0; r < mode.rank(); ++r) {
    const double highest = static_cast<double>(mode.matrices.col(r).cwiseAbs().maxCoeff());
    const double length = static_cast<double>(mode.matrices.col(r).norm());
    const double largest = static_cast<double>(mode.vectors.col(r).cwiseAbs().maxCoeff());
    if (highest > 0.5 * step && largest * length > 0.5 * step) kept.push_back(r);
  }
  for (const Index r : kept) {
    const double length = static_cast<double>(mode.matrices.col(r).norm());
    for (Index i = 0; i < mode.vectors.rows(); ++i)
      numbers.push_back(rounded(static_cast<double>(mode.vectors(i, r)) * length / step));
  }
  for (const Index r : kept) {
    for (Index i = 0; i < mode.matrices.rows(); ++i)
      numbers.push_back(rounded(static_cast<double>(mode.matrices(i, r)) / step));
  }
  return static_cast<int>(kept.size());
}

// Copies factors [n, rank] from parameters, and returns where they end.
const float* copy_factors(const float* from, Index n, Index rank, FloatMatrix& factors) {
  factors = Eigen::Map<const FloatMatrix>(from, n, rank);
  return from + n * rank;
}

}  // namespace

QuantisedLeaf quantise(const Truncation& modes, int nx, int ny, int nz, double step) {
  QuantisedLeaf leaf{.shape = {.nx = nx, .ny = ny, .nz = nz}, .numbers = {}};
  leaf.numbers.reserve(modes.num_parameters());
  leaf.shape.rank_x = append(modes.x, step, leaf.numbers);
  leaf.shape.rank_y = append(modes.y, step, leaf.numbers);
  leaf.shape.rank_z = append(modes.z, step, leaf.numbers);
  return leaf;
}

Truncation dequantised_modes(const QuantisedLeaf& leaf, double step) {
  std::vector<float> parameters(leaf.numbers.size());
  dequantise(leaf, step, parameters);
  const Index nx = leaf.shape.nx, ny = leaf.shape.ny, nz = leaf.shape.nz;
  Truncation modes;
  const float* at = parameters.data();
  const auto read = [&at](Index vector, Index matrix, Index rank, Mode& mode) {
    at = copy_factors(at, vector, rank, mode.vectors);
    at = copy_factors(at, matrix, rank, mode.matrices);
  };
  read(nx, nz * ny, leaf.shape.rank_x, modes.x);
  read(ny, nx * nz, leaf.shape.rank_y, modes.y);
  read(nz, nx * ny, leaf.shape.rank_z, modes.z);
  return modes;
}

}  // namespace tomofield::compact
