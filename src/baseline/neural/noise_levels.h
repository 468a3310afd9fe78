#pragma once

#include <span>
#include <vector>

namespace tomofield::baseline {

/// Learns the standard deviation σ of each view's noise with a reconstruction. The levels minimise
/// the negative log-likelihood of Gaussian residuals,
///   Σ_view ( Σ residual² / (2 σ²) + n log σ )   (after Kniesel et al. 2022).
class NoiseLevels {
 public:
  /// Begins at the levels `start`, which are positive.
  explicit NoiseLevels(const std::vector<double>& start)
      : start_(start), log_ratio_(start.size()) {}

  /// Takes one step down, from the number and the sum of squares of some residuals of every view.
  /// The information of log σ is 2 n, so the natural gradient (Amari 1998) of a view is
  ///   ½ (1 − Σ residual² / (n σ²)).
  /// Its length does not depend on the view. A `rate` of 1 would forget what was learned before.
  void step(std::span<const double> counts, std::span<const double> squares, double rate);
  double sigma(std::size_t view) const;
  /// Returns the negative log-likelihood, less a constant. It equals the data term while the levels
  /// are those of the start.
  double objective(std::span<const double> counts, std::span<const double> squares) const;

 private:
  std::vector<double> start_;
  std::vector<double> log_ratio_;  // log(σ / start)
};

}  // namespace tomofield::baseline
