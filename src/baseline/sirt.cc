#include "baseline/sirt.h"

#include <nlohmann/json.hpp>
#include <vector>

#include "baseline/row_action.h"

namespace tomofield::baseline {

nlohmann::json SirtOptions::json() const {
  return {{"iterations", iterations}, {"relaxation", relaxation}, {"non_negative", non_negative}};
}

Solution reconstruct_sirt(VoxelProblem& problem, const SirtOptions& options,
                          const AfterIteration& after_iteration) {
  Solution solution{VoxelVolume(problem.grid(), problem.num_rows()), {}, {}};
  VoxelVolume& densities = solution.densities;
  ThreadScratch scratch(problem.detector_size(), problem.grid().size());
  VoxelVolume inverse_columns(problem.grid(), problem.num_rows());
  base::parallel_for(problem.num_slabs(), [&](std::int64_t index) {
    const int slab = static_cast<int>(index);
    inverse_column_sums(problem, slab, problem.views(), scratch.detector(),
                        inverse_columns.slab(slab));
  });
  std::vector<std::vector<loss::ViewSums>> sums(static_cast<std::size_t>(problem.num_slabs()));
  for (int iteration = 0;; ++iteration) {
    const bool is_last = iteration == options.iterations;
    solution.objective.push_back(sum_over_slabs(problem.num_slabs(), [&](int slab) {
      float* residuals = scratch.detector();
      sums[static_cast<std::size_t>(slab)] =
          problem.residuals(slab, problem.views(), densities.slab(slab), residuals);
      const double objective = weigh_rays(problem, problem.views(), residuals) / 2;
      if (is_last) return objective;
      float* gradient = scratch.cleared_samples();
      problem.backproject(problem.views(), residuals, gradient);
      take_step(problem.grid(), options.relaxation, options.non_negative,
                inverse_columns.slab(slab), gradient, densities.slab(slab));
      return objective;
    }));
    const std::vector<loss::ViewSums> all = total(sums);
    solution.data_loss.push_back(problem.data_loss(all));
    if (is_last) return solution;
    problem.fit_view_models(all);
    after_iteration({iteration + 1, solution.data_loss.back(), solution.objective.back()},
                    densities);
  }
}

}  // namespace tomofield::baseline
