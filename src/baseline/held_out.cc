#include "baseline/held_out.h"

namespace tomofield::baseline {

measurement::ViewErrors held_out_errors(const VoxelProblem& problem, const std::vector<int>& views,
                                        bool fit_view_scale, VoxelVolume& densities) {
  std::vector<double> weights;
  for (const double sigma : problem.noise_sigma()) weights.push_back(1 / (sigma * sigma));
  return measurement::view_errors(views, {view_sums(problem, views, densities)}, weights,
                                  fit_view_scale);
}

}  // namespace tomofield::baseline
