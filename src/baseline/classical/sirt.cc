#include "baseline/classical/sirt.h"

#include <nlohmann/json.hpp>
#include <vector>

#include "baseline/classical/row_action.h"

namespace tomofield::baseline {

nlohmann::json SirtOptions::json() const {
  return {{"iterations", iterations}, {"relaxation", relaxation}, {"non_negative", non_negative}};
}

Solution reconstruct_sirt(VoxelProblem& problem, const SirtOptions& options,
                          const AfterIteration& after_iteration) {
  Solution solution{VoxelVolume(problem.grid(), problem.num_rows()), {}, {}};
  VoxelVolume& densities = solution.densities;
  ThreadScratch scratch(problem);
  VoxelVolume inverse_columns(problem.grid(), problem.num_rows());
  for_each_pair(problem.num_slabs(), [&](const SlabPair& pair) {
    inverse_column_sums(problem, pair, problem.views(), scratch.detector(),
                        inverse_columns.slab(pair.first));
  });
  std::vector<std::vector<measurement::ViewSums>> sums(problem.num_pairs());
  for (int iteration = 0;; ++iteration) {
    const bool is_last = iteration == options.iterations;
    solution.objective.push_back(sum_over_pairs(problem.num_slabs(), [&](const SlabPair& pair) {
      float *residuals = scratch.detector(), *x = densities.slab(pair.first);
      sums[pair.index()] = problem.residuals(pair, problem.views(), x, residuals);
      const double objective = weigh_rays(problem, pair, problem.views(), residuals) / 2;
      if (is_last) return objective;
      float* gradient = scratch.samples();
      problem.backproject(problem.views(), residuals, gradient, pair.count);
      take_step(problem.grid(), pair, options.relaxation, options.non_negative,
                inverse_columns.slab(pair.first), gradient, x);
      return objective;
    }));
    const std::vector<measurement::ViewSums> all = total(sums);
    solution.data_loss.push_back(problem.data_loss(all));
    if (is_last) return solution;
    problem.fit_view_models(all);
    after_iteration({iteration + 1, solution.data_loss.back(), solution.objective.back()},
                    densities);
  }
}

}  // namespace tomofield::baseline
