#include "baseline/method.h"

namespace tomofield::baseline {
namespace {

Solution reconstruct_with(const WbpOptions& options, VoxelProblem& problem, double mean_density,
                          const AfterIteration& after_iteration) {
  return reconstruct_wbp(problem, options, mean_density, after_iteration);
}

Solution reconstruct_with(const SirtOptions& options, VoxelProblem& problem, double,
                          const AfterIteration& after_iteration) {
  return reconstruct_sirt(problem, options, after_iteration);
}

Solution reconstruct_with(const SartTvOptions& options, VoxelProblem& problem, double mean_density,
                          const AfterIteration& after_iteration) {
  return reconstruct_sart_tv(problem, options, mean_density, after_iteration);
}

Solution reconstruct_with(const TvOptions& options, VoxelProblem& problem, double mean_density,
                          const AfterIteration& after_iteration) {
  return reconstruct_tv(problem, options, mean_density, after_iteration);
}

Solution reconstruct_with(const IngpOptions& options, VoxelProblem& problem, double mean_density,
                          const AfterIteration& after_iteration) {
  return reconstruct_ingp(problem, options, mean_density, after_iteration);
}

Solution reconstruct_with(const FourierNetOptions& options, VoxelProblem& problem,
                          double mean_density, const AfterIteration& after_iteration) {
  return reconstruct_fourier_net(problem, options, mean_density, after_iteration);
}

}  // namespace

MethodFacts facts_of(const Method& method) {
  return std::visit([](const auto& options) { return options.facts(); }, method);
}

MethodSize size_of(const Method& method, const projection::SampleGrid& grid,
                   std::int64_t num_rows) {
  return std::visit(
      [&](const auto& options) -> MethodSize {
        if constexpr (requires { options.size(grid, num_rows); })
          return options.size(grid, num_rows);
        else
          return {num_voxels(grid, num_rows), 0};
      },
      method);
}

std::optional<double> last_decrease(const Solution& solution) {
  const std::vector<double>& objective = solution.objective;
  if (objective.size() < 2) return std::nullopt;
  const double before = objective[(objective.size() - 1) * 9 / 10];
  return (before - objective.back()) / objective.back();
}

Solution reconstruct(VoxelProblem& problem, const Method& method, double mean_density,
                     const AfterIteration& after_iteration) {
  return std::visit(
      [&](const auto& options) {
        return reconstruct_with(options, problem, mean_density, after_iteration);
      },
      method);
}

}  // namespace tomofield::baseline
