#include "compact/truncation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace tomofield::compact {
namespace {

using Eigen::Index;

constexpr int kMaxSweeps = 6;
constexpr double kMinGain = 2e-3;  // of a sweep, relative to the sum that is minimised

// Returns the number of the last eigenvalues, which are the largest, that are above a threshold.
Index count_above(const Eigen::VectorXf& eigenvalues, double threshold) {
  return std::count_if(eigenvalues.begin(), eigenvalues.end(),
                       [&](float value) { return static_cast<double>(value) > threshold; });
}

// Returns the leading singular vectors of `unfolded` [n, other axes] whose energy is above a
// threshold, by the eigenvectors of the smaller one of its two Gram matrices.
Mode leading_mode(const FloatMatrix& unfolded, double threshold) {
  using Solver = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXf>;
  Mode mode;
  if (unfolded.rows() <= unfolded.cols()) {
    const Solver eigen(Eigen::MatrixXf(unfolded * unfolded.transpose()));
    const Index rank = count_above(eigen.eigenvalues(), threshold);
    mode.vectors = eigen.eigenvectors().rightCols(rank).rowwise().reverse();
  } else {
    const Solver eigen(Eigen::MatrixXf(unfolded.transpose() * unfolded));
    const Index rank = count_above(eigen.eigenvalues(), threshold);
    mode.vectors = unfolded * eigen.eigenvectors().rightCols(rank).rowwise().reverse();
    mode.vectors.colwise().normalize();
  }
  mode.matrices = unfolded.transpose() * mode.vectors;
  return mode;
}

// Views values [nx, nz·ny] along y, as [nx·nz, ny].
Eigen::Map<const FloatMatrix> lines_along_y(const FloatMatrix& values, Index ny) {
  return {values.data(), values.size() / ny, ny};
}

// Copies values [nx, nz·ny] to sections [nz, nx·ny].
FloatMatrix sections_of(const FloatMatrix& values, Index ny) {
  const Index nz = values.cols() / ny;
  FloatMatrix sections(nz, values.rows() * ny);
  for (Index x = 0; x < values.rows(); ++x) {
    const Eigen::Map<const FloatMatrix> section(values.row(x).data(), nz, ny);
    sections.middleCols(x * ny, ny) = section;
  }
  return sections;
}

void add_sections(const FloatMatrix& sections, float factor, FloatMatrix& values) {
  const Index nz = sections.rows(), ny = values.cols() / nz;
  for (Index x = 0; x < values.rows(); ++x) {
    Eigen::Map<FloatMatrix> section(values.row(x).data(), nz, ny);
    section += factor * sections.middleCols(x * ny, ny);
  }
}

// Add modes times a factor to values [nx, nz·ny].
void add_x(const Mode& mode, float factor, FloatMatrix& values) {
  if (mode.rank() > 0) values.noalias() += factor * mode.vectors * mode.matrices.transpose();
}
void add_y(const Mode& mode, float factor, FloatMatrix& values) {
  if (mode.rank() == 0) return;
  Eigen::Map<FloatMatrix> lines(values.data(), mode.matrices.rows(), mode.vectors.rows());
  lines.noalias() += factor * mode.matrices * mode.vectors.transpose();
}
void add_z(const Mode& mode, float factor, FloatMatrix& values) {
  if (mode.rank() > 0) add_sections(mode.vectors * mode.matrices.transpose(), factor, values);
}

}  // namespace

Truncation truncate(const PlaceDensities& place, double price) {
  const Index nx = place.nx, ny = place.ny, nz = place.nz;
  const auto threshold = [&](Index a, Index b, Index c) {
    return price * static_cast<double>(a + b * c);
  };
  Truncation modes;
  FloatMatrix rest = place.values;
  double sum = -1;
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    add_z(modes.z, 1, rest);
    modes.z = leading_mode(sections_of(rest, ny), threshold(nz, nx, ny));
    add_z(modes.z, -1, rest);
    add_x(modes.x, 1, rest);
    modes.x = leading_mode(rest, threshold(nx, nz, ny));
    add_x(modes.x, -1, rest);
    add_y(modes.y, 1, rest);
    modes.y = leading_mode(lines_along_y(rest, ny).transpose(), threshold(ny, nx, nz));
    add_y(modes.y, -1, rest);
    modes.square_error = static_cast<double>(rest.squaredNorm());
    const double before = sum;
    sum = modes.square_error + price * static_cast<double>(modes.num_parameters());
    if (modes.x.rank() + modes.y.rank() == 0) break;  // the z mode alone is exact
    if (before >= 0 && sum > (1 - kMinGain) * before) break;
  }
  return modes;
}

Eigen::VectorXf energies_of_sections(const PlaceDensities& place) {
  const FloatMatrix sections = sections_of(place.values, place.ny);
  const bool is_flat = sections.rows() <= sections.cols();
  const Eigen::MatrixXf gram = is_flat ? Eigen::MatrixXf(sections * sections.transpose())
                                       : Eigen::MatrixXf(sections.transpose() * sections);
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXf>(gram, Eigen::EigenvaluesOnly).eigenvalues();
}

FloatMatrix values_of(const Truncation& modes, int nx, int ny, int nz) {
  FloatMatrix values = FloatMatrix::Zero(nx, Index{nz} * ny);
  add_x(modes.x, 1, values);
  add_y(modes.y, 1, values);
  add_z(modes.z, 1, values);
  return values;
}

}  // namespace tomofield::compact
