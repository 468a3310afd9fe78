#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/aligned_buffer.h"
#include "baseline/neural/dense_network.h"
#include "baseline/neural/encodings.h"
#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

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

/// Adam (kernels/adam.h) for parameters of which a step may touch few, such as those of a hash
/// grid. A block of parameters whose gradient is zero keeps its values and its moments. Otherwise
/// it would drift on while nothing is known about it (as in Müller et al. 2022, section 4).
class LazyAdam {
 public:
  explicit LazyAdam(std::size_t num_parameters);

  /// Returns the gradient of the next step. It is zero at first and after each step.
  std::span<float> gradient() { return gradient_; }
  void step(double learning_rate, std::span<float> parameters);

 private:
  void step_block(std::size_t block, double learning_rate, std::span<float> parameters);

  base::AlignedBuffer<float> gradient_, m_, v_;
  std::vector<std::int32_t> steps_;  // [block]
};

/// The options that every method that fits a network has.
struct NetworkOptions {
  int iterations = 100;  ///< passes over all rows; a step is four rows with all views
  int hidden_layers = 2, width = 32;
  double learning_rate = 0.01;  ///< falls exponentially to a tenth
  bool non_negative = true;     ///< softplus of the network's output, or the output itself
  std::uint64_t seed = 1;
  Activation activation = Activation::kRectifier;  ///< activation of the hidden layers
};

/// Returns the number of parameters of a network and the memory that its fit takes.
MethodSize network_size(const projection::SampleGrid& grid, std::int64_t num_rows,
                        const PointEncoding& encoding, const NetworkOptions& options);

/// Fits a network (network_density.h) to the views by Adam and samples it at the voxels. There is
/// no explicit prior. A step uses the data term of all views in a few rows (RowSet); the sets come
/// in random order. With `learns_noise`, the noise of each view is learned too (NoiseLevels) and
/// weighs the view. `mean_density` is the density at the start.
Solution fit_network(VoxelProblem& problem, const NetworkOptions& options,
                     std::unique_ptr<PointEncoding> encoding, double mean_density,
                     bool learns_noise, const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
