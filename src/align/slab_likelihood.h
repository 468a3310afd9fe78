#pragma once

#include <vector>

#include <Eigen/Core>

#include "align/slab_model.h"

namespace tomofield::align {

/// Computes how unlikely the views of a slab are at their present positions. At each frequency the
/// views' transforms are Gaussian with the covariance K = c C + (1 − c) I, where C is the
/// correlation of the slab model and c the share of the signal in the power of the shell:
///
///   −log likelihood = Σ_k log det K + z^H K⁻¹ z.
class SlabLikelihood {
 public:
  explicit SlabLikelihood(const SlabModel& model);

  /// Returns minus the logarithm of the likelihood. The transforms are first divided by the
  /// amplitude of each view and by the power of each shell, and c is the most likely share.
  double cost(Spectra spectra) const;

 private:
  // The eigenvectors of the correlation at one column, without those of tiny eigenvalues.
  struct Column {
    Eigen::MatrixXd basis;  // [view, mode]
    Eigen::VectorXd eigenvalues;
    double num_views = 0.0;  // that have a signal here
  };
  void normalise(Spectra& spectra) const;
  void divide_by_shells(Spectra& spectra) const;
  void divide_by_views(Spectra& spectra) const;
  double cost_of(const Column& column, double coherence, double power,
                 const Eigen::VectorXd& mode_power) const;

  const SlabModel* model_;
  std::vector<Column> columns_;
  std::size_t num_shells_ = 0;
};

}  // namespace tomofield::align
