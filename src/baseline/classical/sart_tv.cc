#include "baseline/classical/sart_tv.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <vector>

#include "baseline/classical/row_action.h"
#include "baseline/classical/variation_descent.h"

namespace tomofield::baseline {
namespace {

// The factor between the relaxations of two passes.
constexpr double kFall = 0.97;

// Puts every Nth view, in the order of tilts, into one of N subsets, so that each subset sees the
// specimen from all around.
std::vector<std::vector<int>> interleaved_subsets(const VoxelProblem& problem, int num_subsets) {
  std::vector<int> by_tilt = problem.views();
  const std::vector<double>& tilts = problem.projector().geometry().tilt_deg;
  std::ranges::stable_sort(by_tilt, {},
                           [&](int view) { return tilts[static_cast<std::size_t>(view)]; });
  const std::size_t count = std::min(static_cast<std::size_t>(num_subsets), problem.views().size());
  std::vector<std::vector<int>> subsets(count);
  for (std::size_t i = 0; i < by_tilt.size(); ++i) subsets[i % count].push_back(by_tilt[i]);
  return subsets;
}

class Sart {
 public:
  Sart(const VoxelProblem& problem, const SartTvOptions& options)
      : problem_(problem),
        non_negative_(options.non_negative),
        subsets_(interleaved_subsets(problem, options.subsets)),
        scratch_(problem, subsets_.front().size(), 3) {}

  // Takes a step with each subset. Rows do not depend on each other, so neither do slabs. Returns
  // the distance that the densities moved.
  double pass(double relaxation, VoxelVolume& densities) {
    return std::sqrt(sum_over_pairs(problem_.num_slabs(), [&](const SlabPair& pair) {
      float *x = densities.slab(pair.first), *before = scratch_.samples(0);
      const std::size_t size = problem_.grid().size();
      std::copy_n(x, static_cast<std::size_t>(pair.count) * size, before);
      for (const std::vector<int>& views : subsets_) step(pair, views, relaxation, x);
      double moved = 0.0;
      for (int i = 0; i < pair.count; ++i, x += size, before += size)
        moved += squared_distance(problem_.grid(), x, before);
      return moved;
    }));
  }

 private:
  void step(const SlabPair& pair, const std::vector<int>& views, double relaxation, float* x) {
    float* detector = scratch_.detector();
    float *inverse_columns = scratch_.samples(1), *gradient = scratch_.samples(2);
    inverse_column_sums(problem_, pair, views, detector, inverse_columns);
    problem_.residuals(pair, views, x, detector);
    weigh_rays(problem_, pair, views, detector);
    problem_.backproject(views, detector, gradient, pair.count);
    take_step(problem_.grid(), pair, relaxation, non_negative_, inverse_columns, gradient, x);
  }

  const VoxelProblem& problem_;
  bool non_negative_;
  std::vector<std::vector<int>> subsets_;
  ThreadScratch scratch_;
};

}  // namespace

nlohmann::json SartTvOptions::json() const {
  return {{"iterations", iterations}, {"subsets", subsets}, {"relaxation", relaxation},
          {"tv_steps", tv_steps},     {"weight", weight},   {"non_negative", non_negative}};
}

Solution reconstruct_sart_tv(VoxelProblem& problem, const SartTvOptions& options, double start,
                             const AfterIteration& after_iteration) {
  Solution solution{VoxelVolume(problem.grid(), problem.num_rows()), {}, {}};
  VoxelVolume& densities = solution.densities;
  densities.fill(static_cast<float>(options.non_negative ? std::max(0.0, start) : start));
  Sart sart(problem, options);
  VariationDescent descent(problem.grid(), problem.num_rows());
  for (int iteration = 0;; ++iteration) {
    const std::vector<measurement::ViewSums> sums = view_sums(problem, problem.views(), densities);
    solution.data_loss.push_back(problem.data_loss(sums));
    solution.objective.push_back(solution.data_loss.back());
    if (iteration == options.iterations) return solution;
    problem.fit_view_models(sums);
    const double change = sart.pass(options.relaxation * std::pow(kFall, iteration), densities);
    for (int i = 0; i < options.tv_steps; ++i)
      descent.step(options.weight * change / options.tv_steps, options.non_negative, densities);
    after_iteration({iteration + 1, solution.data_loss.back(), solution.objective.back()},
                    densities);
  }
}

}  // namespace tomofield::baseline
