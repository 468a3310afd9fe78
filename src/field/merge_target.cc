#include "field/merge_target.h"

#include <vector>

#include "field/sampling/resample.h"

namespace tomofield::field {
namespace {

// Returns the interpolation matrix [n, n] from an axis' vertices to those of its first or second
// half.
Eigen::MatrixXd half_interpolation(int n, int half) {
  Eigen::MatrixXd p = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i) {
    const AxisPoint at(0.5 * half * (n - 1) + 0.5 * i, n);
    p(i, at.lower) = 1 - at.fraction;
    p(i, at.lower + 1) = at.fraction;
  }
  return p;
}

Eigen::MatrixXd normal_cholesky(int n) {
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
  for (const int half : {0, 1}) {
    const Eigen::MatrixXd p = half_interpolation(n, half);
    normal += p.transpose() * p;
  }
  return normal.llt().matrixL();
}

// Returns the vertex values [x, z·y] of a leaf without the bias.
RowMajorMatrix vertex_values(const Field& field, int leaf) {
  const LeafShape& s = field.shape(leaf);
  const Square& square = field.tree().leaf(leaf).square;
  RowMajorMatrix values(s.nx, static_cast<Eigen::Index>(s.nz) * s.ny);
  std::vector<float> row(s.vertices_xz());
  for (int j = 0; j < s.ny; ++j) {
    const double y = kPixelCentre + static_cast<double>(square.y0) +
                     static_cast<double>(square.size) * j / static_cast<double>(s.ny - 1);
    field.row_values(leaf, y, row.data());
    for (int i = 0; i < s.nx; ++i) {
      for (int k = 0; k < s.nz; ++k)
        values(i, static_cast<Eigen::Index>(k) * s.ny + j) =
            static_cast<double>(row[static_cast<std::size_t>(i) * s.nz + k]) -
            static_cast<double>(field.bias);
    }
  }
  return values;
}

}  // namespace

MergeTarget make_merge_target(const Field& field, int first_leaf) {
  const LeafShape& s = field.shape(first_leaf);
  MergeTarget target{normal_cholesky(s.nx), normal_cholesky(s.ny), {}};
  RowMajorMatrix right = RowMajorMatrix::Zero(s.nx, static_cast<Eigen::Index>(s.nz) * s.ny);
  Eigen::Map<RowMajorMatrix> right_y(right.data(), static_cast<Eigen::Index>(s.nx) * s.nz, s.ny);
  for (int c = 0; c < 4; ++c) {
    const RowMajorMatrix along_x =
        half_interpolation(s.nx, c & 1).transpose() * vertex_values(field, first_leaf + c);
    right_y += Eigen::Map<const RowMajorMatrix>(along_x.data(), right_y.rows(), s.ny) *
               half_interpolation(s.ny, c >> 1);
  }
  // Solves B = Lx⁻¹ right Ly⁻ᵀ.
  target.chol_x.triangularView<Eigen::Lower>().solveInPlace(right);
  const RowMajorMatrix solved =
      target.chol_y.triangularView<Eigen::Lower>().solve(right_y.transpose()).transpose();
  target.b = Eigen::Map<const RowMajorMatrix>(solved.data(), s.nx, right.cols());
  return target;
}

}  // namespace tomofield::field
