#include "baseline/classical/sart_tv.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "baseline/classical/sirt.h"
#include "baseline/classical/slab_gradient.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;
using projection::SampleSegment;

constexpr float kFloor = 1e-3f;  // ε, in density units a pixel

// Returns the factors of ∇.
GradientFactors per_spacing(const SampleSegment& segment) {
  return {static_cast<float>(1 / segment.hx), 1.0f, static_cast<float>(1 / segment.hz)};
}

// Returns Σ h_x h_z value(i)² over a slab's samples.
template <typename Value>
double sum_of_squares(const projection::SampleGrid& grid, Value&& value) {
  double sum = 0.0;
  for_each_sample_row(grid, [&](const SampleSegment& segment, std::ptrdiff_t row) {
    float sums[kLanes] = {};
    for (std::ptrdiff_t at = row; at < row + std::ptrdiff_t{segment.nx} * kLanes; at += kLanes) {
      for (int l = 0; l < kLanes; ++l) sums[l] += value(at + l) * value(at + l);
    }
    for (const float of_lane : sums) sum += segment.hx * segment.hz * static_cast<double>(of_lane);
  });
  return sum;
}

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

VariationDescent::VariationDescent(const projection::SampleGrid& grid, std::int64_t num_rows)
    : px_(grid, num_rows), py_(grid, num_rows), pz_(grid, num_rows), gradient_(grid, num_rows) {}

double VariationDescent::step(double length, bool non_negative, VoxelVolume& densities) {
  const double variation = measure_directions(densities);
  const double slope = measure_gradient();
  if (slope == 0.0) return variation;
  const float rate = static_cast<float>(length / slope);
  const float lowest = non_negative ? 0.0f : std::numeric_limits<float>::lowest();
  base::parallel_for("update slabs", densities.num_slabs(), [&](std::int64_t index) {
    const int slab = static_cast<int>(index);
    float* x = densities.slab(slab);
    const float* gradient = gradient_.slab(slab);
    for_each_sample_row(densities.grid(), [&](const SampleSegment& segment, std::ptrdiff_t row) {
      for (std::ptrdiff_t i = row; i < row + std::ptrdiff_t{segment.nx} * kLanes; ++i)
        x[i] = std::max(lowest, x[i] - rate * gradient[i]);
    });
  });
  return variation;
}

double VariationDescent::measure_directions(const VoxelVolume& densities) {
  return sum_over_slabs(densities.num_slabs(), [&](int slab) {
    double variation = 0.0;
    for_each_gradient_row(densities, slab, per_spacing, [&](const GradientRow& g) {
      float *px = px_.slab(slab) + g.row, *py = py_.slab(slab) + g.row,
            *pz = pz_.slab(slab) + g.row;
      float sums[kLanes] = {};
      for (std::size_t at = 0; at < g.count; at += kLanes) {
        for (std::size_t l = 0; l < kLanes; ++l) {
          const std::size_t i = at + l;
          const float m =
              std::sqrt(g.x[i] * g.x[i] + g.y[i] * g.y[i] + g.z[i] * g.z[i] + kFloor * kFloor);
          px[i] = g.x[i] / m;
          py[i] = g.y[i] / m;
          pz[i] = g.z[i] / m;
          sums[l] += m;
        }
      }
      for (int l = 0; l < densities.rows_in_slab(slab); ++l)
        variation += static_cast<double>(sums[l]) / static_cast<double>(g.factors.x * g.factors.z);
    });
    return variation;
  });
}

// Computes the gradient of the variation and returns its length.
double VariationDescent::measure_gradient() {
  return std::sqrt(sum_over_slabs(gradient_.num_slabs(), [&](int slab) {
    float* gradient = gradient_.slab(slab);
    std::fill_n(gradient, gradient_.grid().size(), 0.0f);
    add_gradient_adjoint(px_, py_, pz_, slab, per_spacing, gradient);
    return sum_of_squares(gradient_.grid(), [&](std::ptrdiff_t i) { return gradient[i]; });
  }));
}

double squared_distance(const projection::SampleGrid& grid, const float* x, const float* y) {
  return sum_of_squares(grid, [&](std::ptrdiff_t i) { return x[i] - y[i]; });
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
