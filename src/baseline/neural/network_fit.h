#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>

#include "baseline/neural/dense_network.h"
#include "baseline/neural/encodings.h"
#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

/// The options that every method that fits a network has.
struct NetworkOptions {
  int iterations = 100;  ///< passes over all rows; a step is four rows with all views
  int hidden_layers = 2, width = 32;
  double learning_rate = 0.01;  ///< falls exponentially to a tenth
  bool non_negative = true;     ///< softplus of the network's output, or the output itself
  std::uint64_t seed = 1;
  Activation activation = Activation::kRectifier;  ///< activation of the hidden layers
  nlohmann::json json() const;
};

/// Returns the number of parameters of a network and the memory that its fit takes.
MethodSize network_size(const projection::SampleGrid& grid, std::int64_t num_rows,
                        const PointEncoding& encoding, const NetworkOptions& options);

/// Fits a network (network_density.h) to the views by Adam and samples it at the voxels. There is
/// no explicit prior. A step uses the data term of all views in a few rows (RowSet); the sets come
/// in random order. With `learns_noise`, the noise of each view is learned too (noise_levels.h) and
/// weighs the view. `mean_density` is the density at the start.
Solution fit_network(VoxelProblem& problem, const NetworkOptions& options,
                     std::unique_ptr<PointEncoding> encoding, double mean_density,
                     bool learns_noise, const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
