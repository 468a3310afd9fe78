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
  nlohmann::json json() const;
  MethodSize size(const projection::SampleGrid& samples, std::int64_t num_rows) const;
};

/// Reconstructs with fit_network().
Solution reconstruct_ingp(VoxelProblem& problem, const IngpOptions& options, double mean_density,
                          const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
