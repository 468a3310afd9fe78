#include "field/vm/merge_factors.h"

#include <algorithm>
#include <cstddef>

#include "field/vm/vm_field.h"

namespace tomofield::field {
namespace {

constexpr int kMaxSweeps = 60;
constexpr double kMinChange = 1e-3;  // relative to the residual's square, in a sweep
constexpr double kExact = 1e-13;     // relative to the target's square: the floats' rounding
constexpr double kProximity = 1e-6;  // relative to the mean diagonal of the normal matrix

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
class SectionMajor {
 public:
  SectionMajor(RowMajorMatrix& residual, Eigen::Index nz, Eigen::Index ny)
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
  SectionMajor by_section(residual, nz, ny);
  improve(by_section.sections(), f.mxy, f.vz);
  improve(by_section.sections().transpose(), f.vz, f.mxy);
  by_section.put_back();
  return residual.squaredNorm();
}

RowMajorMatrix residual_of(const RowMajorMatrix& b, const LeafFactors& f) {
  const Eigen::Index nx = f.vx.rows(), ny = f.vy.rows(), nz = f.vz.rows();
  RowMajorMatrix residual = b - f.vx * f.myz.transpose();
  Eigen::Map<RowMajorMatrix>(residual.data(), nx * nz, ny) -= f.mxz * f.vy.transpose();
  SectionMajor by_section(residual, nz, ny);
  by_section.sections() -= f.vz * f.mxy.transpose();
  by_section.put_back();
  return residual;
}

// Converts factors between a leaf's parameters and the coordinates of a merge (MergeTarget).
class FactorMaps {
 public:
  FactorMaps(const LeafShape& shape, const MergeTarget& target)
      : s_(shape), at_(shape), target_(target) {}

  LeafFactors read(const float* p) const {
    LeafFactors f;
    f.vx = factor(p + at_.vx, s_.nx, s_.rank_x);
    f.myz = factor(p + at_.myz, s_.nz * s_.ny, s_.rank_x);
    f.vy = factor(p + at_.vy, s_.ny, s_.rank_y);
    f.mxz = factor(p + at_.mxz, s_.nx * s_.nz, s_.rank_y);
    f.vz = factor(p + at_.vz, s_.nz, s_.rank_z);
    f.mxy = factor(p + at_.mxy, s_.nx * s_.ny, s_.rank_z);
    const auto times = [](const Eigen::MatrixXd& chol) {
      return [&chol](auto&& block) { block = (chol.transpose() * block).eval(); };
    };
    apply(f, times(target_.chol_x), times(target_.chol_y));
    return f;
  }

  void write(LeafFactors f, float* p) const {
    const auto solve = [](const Eigen::MatrixXd& chol) {
      return [&chol](auto&& block) {
        block = chol.transpose().triangularView<Eigen::Upper>().solve(block.eval()).eval();
      };
    };
    apply(f, solve(target_.chol_x), solve(target_.chol_y));
    const auto copy = [p](const RowMajorMatrix& from, std::size_t to) {
      std::copy_n(from.data(), from.size(), p + to);
    };
    copy(f.vx, at_.vx);
    copy(f.myz, at_.myz);
    copy(f.vy, at_.vy);
    copy(f.mxz, at_.mxz);
    copy(f.vz, at_.vz);
    copy(f.mxy, at_.mxy);
  }

 private:
  static RowMajorMatrix factor(const float* p, Eigen::Index rows, Eigen::Index rank) {
    using Floats = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    return Eigen::Map<const Floats>(p, rows, rank).cast<double>();
  }

  // Applies one function along x of the three factors that have an x, and one along y likewise.
  template <typename AlongX, typename AlongY>
  void apply(LeafFactors& f, const AlongX& along_x, const AlongY& along_y) const {
    const auto flat = [](RowMajorMatrix& m, Eigen::Index rows) {
      return Eigen::Map<RowMajorMatrix>(m.data(), rows, m.size() / rows);
    };
    along_x(flat(f.vx, s_.nx));
    along_x(flat(f.mxz, s_.nx));
    along_x(flat(f.mxy, s_.nx));
    along_y(flat(f.vy, s_.ny));
    for (int k = 0; k < s_.nz; ++k)
      along_y(f.myz.middleRows(static_cast<Eigen::Index>(k) * s_.ny, s_.ny));
    for (int i = 0; i < s_.nx; ++i)
      along_y(f.mxy.middleRows(static_cast<Eigen::Index>(i) * s_.ny, s_.ny));
  }

  const LeafShape& s_;
  VmLayout at_;
  const MergeTarget& target_;
};

}  // namespace

double fit_factors(const RowMajorMatrix& b, LeafFactors& factors) {
  RowMajorMatrix residual = residual_of(b, factors);
  double square = residual.squaredNorm();
  for (int n = 0; n < kMaxSweeps && square > kExact * b.squaredNorm(); ++n) {
    const double before = square;
    square = sweep(residual, factors);
    if (square > (1 - kMinChange) * before) break;
  }
  return square;
}

void merge_factors(const LeafShape& shape, const MergeTarget& target, float* parameters) {
  const FactorMaps maps(shape, target);
  LeafFactors factors = maps.read(parameters);
  fit_factors(target.b, factors);
  maps.write(factors, parameters);
}

}  // namespace tomofield::field
