#pragma once

#include <Eigen/Dense>

#include <algorithm>
#include <cstddef>

#include "field/vm/merge_factors.h"
#include "field/vm/merge_target.h"
#include "field/vm/vm_layout.h"

namespace tomofield::field {

/// Converts factors between a leaf's parameters and the coordinates of a merge (MergeTarget).
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

}  // namespace tomofield::field
