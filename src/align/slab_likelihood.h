#pragma once

#include <vector>

#include <Eigen/Core>

#include "align/slab_model.h"

namespace tomofield::align {

/// Holds how a sum over frequencies changes with the positions of the views, x0, x1, … y0, y1, …
struct PositionDerivatives {
  Eigen::VectorXd gradient;
  Eigen::MatrixXd hessian;
};

/// Computes how unlikely the views of a slab are at their present positions. At each frequency the
/// views' transforms are Gaussian with the covariance K = c C + (1 − c) I, where C is the
/// correlation of the slab model and c the share of the signal in the power of the shell:
///
///   −log likelihood = Σ_k log det K + z^H K⁻¹ z.
///
/// Moving view i by u_i multiplies its transform by exp(2πi k·u_i). All views count together, so
/// errors do not accumulate from neighbour to neighbour as they do in pairwise correlation.
class SlabLikelihood {
 public:
  explicit SlabLikelihood(const SlabModel& model);

  /// Divides the transforms by the amplitude of each view and by the power of each shell.
  void normalise(Spectra& spectra) const;
  /// Returns the most likely share of the signal in each shell of normalised transforms.
  std::vector<double> estimate_coherence(const Spectra& spectra) const;
  /// Returns minus the logarithm of the likelihood.
  double cost(const Spectra& spectra, const std::vector<double>& coherence) const;
  /// Returns the exact first and second derivatives of cost() with respect to the positions, in
  /// pixels of the stretched views.
  PositionDerivatives derivatives(const Spectra& spectra,
                                  const std::vector<double>& coherence) const;

 private:
  // The eigenvectors of the correlation at one column, without those of tiny eigenvalues.
  struct Column {
    Eigen::MatrixXd basis;  // [view, mode]
    Eigen::VectorXd eigenvalues;
    double num_views = 0.0;  // that have a signal here
  };
  double cost_of(const Column& column, double coherence, double power,
                 const Eigen::VectorXd& mode_power) const;

  const SlabModel* model_;
  std::vector<Column> columns_;
  std::size_t num_shells_ = 0;
};

}  // namespace tomofield::align
