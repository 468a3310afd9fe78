#pragma once

#include <span>
#include <vector>

namespace tomofield::baseline {

/// The standard deviation σ of each view's noise, learned with a reconstruction: what minimises
/// the negative log-likelihood of Gaussian residuals,
///   Σ_view ( Σ residual² / (2 σ²) + n log σ )   (after Kniesel et al. 2022).
class NoiseLevels {
 public:
  /// `start`: where they start from, positive.
  explicit NoiseLevels(const std::vector<double>& start)
      : start_(start), log_ratio_(start.size()) {}

  /// One step down, from the number and the sum of squares of some residuals of every view. Of
  /// log σ the information is 2 n, so that the natural gradient (Amari 1998) of a view is
  ///   ½ (1 − Σ residual² / (n σ²)),
  /// whose length does not depend on the view; `rate` 1 would forget what was learned before.
  void step(std::span<const double> counts, std::span<const double> squares, double rate);
  double sigma(std::size_t view) const;
  /// The negative log-likelihood, less a constant: it is the data term as long as the levels are
  /// as at the start.
  double objective(std::span<const double> counts, std::span<const double> squares) const;

 private:
  std::vector<double> start_;
  std::vector<double> log_ratio_;  // of σ to where it started
};

}  // namespace tomofield::baseline
