#include "field/vm/merge_factors.h"

namespace tomofield::field {
namespace {

constexpr int kMostSweeps = 60;
constexpr double kLeastChange = 1e-3;  // relative to the residual's square, in a sweep
constexpr double kExact = 1e-13;       // relative to the target's square: the floats' rounding
constexpr double kProximity = 1e-6;    // relative to the mean diagonal of the normal matrix

// Improves `factor` to the least-squares solution of residual + factor otherᵀ ≈ factor' otherᵀ, and
// updates the residual [rows of factor, rows of other].
template <typename Residual>
void improve(Residual&& residual, const RowMajorMatrix& other, RowMajorMatrix& factor) {
  const Eigen::Index rank = other.cols();
  Eigen::MatrixXd normal = other.transpose() * other;
  const double proximity = kProximity * normal.trace() / static_cast<double>(rank);
  if (!(proximity > 0)) return;  // the other factor is zero, so this one has no influence
  normal.diagonal().array() += proximity;
  const Eigen::MatrixXd right = (residual * other).transpose();
  const RowMajorMatrix change = normal.llt().solve(right).transpose();
  factor += change;
  residual -= change * other.transpose();
}

// Copies a residual [nx, nz·ny] to [nz, nx·ny]; put_back() writes it back.
class SectionsFirst {
 public:
  SectionsFirst(RowMajorMatrix& residual, Eigen::Index nz, Eigen::Index ny)
      : residual_(residual), ny_(ny), sections_(nz, residual.rows() * ny) {
    exchange([](auto&& section, auto&& line) { section = line; });
  }
  RowMajorMatrix& sections() { return sections_; }
  void put_back() {
    exchange([](auto&& section, auto&& line) { line = section; });
  }

 private:
  template <typename Copy>
  void exchange(const Copy& copy) {
    for (Eigen::Index i = 0; i < residual_.rows(); ++i) {
      for (Eigen::Index k = 0; k < sections_.rows(); ++k)
        copy(sections_.block(k, i * ny_, 1, ny_), residual_.block(i, k * ny_, 1, ny_));
    }
  }
  RowMajorMatrix& residual_;
  Eigen::Index ny_;
  RowMajorMatrix sections_;
};

double sweep(RowMajorMatrix& residual, LeafFactors& f) {
  const Eigen::Index nx = f.vx.rows(), ny = f.vy.rows(), nz = f.vz.rows();
  improve(residual, f.myz, f.vx);
  improve(residual.transpose(), f.vx, f.myz);
  Eigen::Map<RowMajorMatrix> columns(residual.data(), nx * nz, ny);
  improve(columns, f.vy, f.mxz);
  improve(columns.transpose(), f.mxz, f.vy);
  SectionsFirst by_section(residual, nz, ny);
  improve(by_section.sections(), f.mxy, f.vz);
  improve(by_section.sections().transpose(), f.vz, f.mxy);
  by_section.put_back();
  return residual.squaredNorm();
}

RowMajorMatrix residual_of(const RowMajorMatrix& b, const LeafFactors& f) {
  const Eigen::Index nx = f.vx.rows(), ny = f.vy.rows(), nz = f.vz.rows();
  RowMajorMatrix residual = b - f.vx * f.myz.transpose();
  Eigen::Map<RowMajorMatrix>(residual.data(), nx * nz, ny) -= f.mxz * f.vy.transpose();
  SectionsFirst by_section(residual, nz, ny);
  by_section.sections() -= f.vz * f.mxy.transpose();
  by_section.put_back();
  return residual;
}

}  // namespace

double fit_factors(const RowMajorMatrix& b, LeafFactors& factors) {
  RowMajorMatrix residual = residual_of(b, factors);
  double square = residual.squaredNorm();
  for (int n = 0; n < kMostSweeps && square > kExact * b.squaredNorm(); ++n) {
    const double before = square;
    square = sweep(residual, factors);
    if (square > (1 - kLeastChange) * before) break;
  }
  return square;
}

}  // namespace tomofield::field
