#pragma once

#include "baseline/neural/encodings.h"
#include "baseline/neural/network_fit.h"

namespace tomofield::baseline {

/// A multi-resolution hash grid and a small network (Instant-NGP, Müller et al. 2022).
struct IngpOptions : NetworkOptions {
  HashGridOptions grid;

  MethodFacts facts() const {
    return {.name = "ingp",
            .iterations = iterations,
            .volumes = 1,
            .detectors = 1,
            .memory_advice = "; or fewer --table-bits or --levels, or a smaller --width"};
  }
  MethodSize size(const projection::SampleGrid& samples, std::int64_t num_rows) const;
};

/// Reconstructs with fit_network().
Solution reconstruct_ingp(VoxelProblem& problem, const IngpOptions& options, double mean_density,
                          const AfterIteration& after_iteration);

/// A network of plane waves alone, with sines as activations (Sitzmann et al. 2020). A noise level
/// of each view is learned with it. Kniesel et al. (2022) learn noise that depends on the signal.
struct FourierNetOptions : NetworkOptions {
  FourierNetOptions()
      : NetworkOptions{.hidden_layers = 2,
                       .width = 64,
                       .learning_rate = 0.006,
                       .activation = Activation::kSine} {}
  int features = 128;      ///< plane waves at the network's input (encodings.h)
  double shortest = 20.0;  ///< shortest wavelength of the plane waves, pixels

  MethodFacts facts() const {
    return {.name = "fourier-net",
            .iterations = iterations,
            .volumes = 1,
            .detectors = 1,
            .memory_advice = "; or a smaller --width, or fewer --features"};
  }
  MethodSize size(const projection::SampleGrid& samples, std::int64_t num_rows) const;
};

/// Reconstructs with fit_network().
Solution reconstruct_fourier_net(VoxelProblem& problem, const FourierNetOptions& options,
                                 double mean_density, const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
