#include "baseline/classical/tv_reconstruction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/threads/parallel.h"
#include "baseline/classical/sirt.h"
#include "voxel_comparison.h"

namespace tomofield::baseline {
namespace {

using testing::SphereSeries;

TvOptions options(int iterations, double weight) {
  TvOptions result;
  result.iterations = iterations;
  result.weight = weight;
  return result;
}

Solution solve(VoxelProblem problem, const TvOptions& options, double start = 0.1) {
  return reconstruct_tv(problem, options, start, [](const IterationReport&, const VoxelVolume&) {});
}

class Tv : public testing::OneThread {};

TEST_F(Tv, ABetterOpponentThanSirt) {
  const SphereSeries series;
  VoxelProblem problem = testing::voxel_problem(series);
  SirtOptions sirt_options;
  sirt_options.iterations = 30;
  const Solution sirt =
      reconstruct_sirt(problem, sirt_options, [](const IterationReport&, const VoxelVolume&) {});
  const Solution tv = solve(testing::voxel_problem(series), options(100, 8));
  EXPECT_LT(testing::rms_error(tv.densities), 0.7 * testing::rms_error(sirt.densities));
}

TEST_F(Tv, ConvergesToTheMinimum) {
  const SphereSeries series;
  const Solution some = solve(testing::voxel_problem(series), options(150, 3));
  const Solution many = solve(testing::voxel_problem(series), options(600, 3));
  EXPECT_NEAR(some.objective.back(), many.objective.back(), 0.01 * many.objective.back());
  // Another start leads to the same minimum.
  const Solution other = solve(testing::voxel_problem(series), options(600, 3), 1.0);
  EXPECT_NEAR(other.objective.back(), many.objective.back(), 1e-3 * many.objective.back());
  EXPECT_LT(some.objective.back(), 0.5 * some.objective[10]);
}

TEST_F(Tv, ObjectiveOfAConstantIsItsDataTerm) {
  const SphereSeries series;
  const VoxelProblem problem = testing::voxel_problem(series);
  double expected = 0;
  for (int slab = 0; slab < problem.num_slabs(); ++slab) {
    for (int view = 0; view < series.geometry.num_views(); ++view) {
      const float* rays = series.rays->rays(slab, view);
      for (std::int64_t x = 0; x < SphereSeries::kWidth; ++x) {
        const double length =
            static_cast<double>(problem.ray_lengths(view)[static_cast<std::size_t>(x)]);
        for (int lane = 0; lane < 16; ++lane) {
          if ((series.rays->mask(slab, view)[x] >> lane & 1) == 0) continue;
          expected +=
              std::pow((0.25 * length - static_cast<double>(rays[x * 16 + lane])) / 0.3, 2) / 2;
        }
      }
    }
  }
  const Solution start = solve(testing::voxel_problem(series), options(1, 3), 0.25);
  EXPECT_NEAR(start.objective.front(), expected, 1e-4 * expected);
  EXPECT_EQ(start.objective.front(), start.data_loss.front());
}

TEST_F(Tv, AHugeWeightLeavesTheBestConstant) {
  const SphereSeries series;
  const VoxelProblem problem = testing::voxel_problem(series);
  // The least-squares constant is Σ length · ray / Σ length².
  double product = 0, square = 0;
  for (int slab = 0; slab < problem.num_slabs(); ++slab) {
    for (int view = 0; view < series.geometry.num_views(); ++view) {
      for (std::int64_t i = 0; i < SphereSeries::kWidth * 16; ++i) {
        if ((series.rays->mask(slab, view)[i / 16] >> (i % 16) & 1) == 0) continue;
        const double length =
            static_cast<double>(problem.ray_lengths(view)[static_cast<std::size_t>(i / 16)]);
        product += length * static_cast<double>(series.rays->rays(slab, view)[i]);
        square += length * length;
      }
    }
  }
  const Solution solution = solve(testing::voxel_problem(series), options(400, 2e4));
  double worst = 0;
  testing::for_each_density(solution.densities, [&](int, int, int, float density) {
    worst = std::max(worst, std::abs(static_cast<double>(density) - product / square));
  });
  EXPECT_LT(worst, 0.08 * product / square);  // the start is 46 % away
}

TEST_F(Tv, MoreWeightMeansLessVariation) {
  const SphereSeries series;
  const auto variation = [&](double weight) {
    const Solution s = solve(testing::voxel_problem(series), options(100, weight));
    return (s.objective.back() - s.data_loss.back()) / weight;
  };
  EXPECT_LT(variation(10), variation(3));
  EXPECT_LT(variation(3), variation(1));
}

TvOptions concave(int iterations, double weight) {
  TvOptions result = options(iterations, weight);
  result.penalty = Penalty::kConcave;
  return result;
}

TEST_F(Tv, WeightsTakenAnewLowerTheConcaveObjective) {
  const SphereSeries series;
  const Solution solution = solve(testing::voxel_problem(series), concave(400, 8));
  // The first weights are taken after three tenths of the iterations.
  EXPECT_LT(solution.objective.back(), 0.99 * solution.objective[120]);
  EXPECT_LT(solution.objective[400], 1.001 * solution.objective[300]);
}

TEST_F(Tv, ConcavePenaltyOfHugeTauIsTheSmoothOne) {
  const SphereSeries series;
  TvOptions o = concave(60, 3);
  o.concavity = 1e5;
  const Solution almost = solve(testing::voxel_problem(series), o);
  const Solution smooth = solve(testing::voxel_problem(series), options(60, 3));
  EXPECT_NEAR(almost.objective.back(), smooth.objective.back(), 1e-3 * smooth.objective.back());
}

TEST_F(Tv, ConcavePenaltySparesEdges) {
  const SphereSeries series;
  // The weights are near the best one of each penalty.
  const auto min_error = [&](const auto& options_of, const std::vector<double>& weights) {
    double min = testing::rms_truth();
    for (const double weight : weights) {
      const Solution solution = solve(testing::voxel_problem(series), options_of(150, weight));
      min = std::min(min, testing::rms_error(solution.densities));
    }
    return min;
  };
  EXPECT_LT(min_error(concave, {36, 54}), 0.97 * min_error(options, {12, 18, 27}));
}

TEST_F(Tv, SlabsAreSeamless) {
  // Averaged over the plane, rows 15 and 16 differ no more than their neighbours do.
  const SphereSeries series;
  const Solution solution = solve(testing::voxel_problem(series), options(100, 3));
  std::vector<double> steps(SphereSeries::kRows - 1);
  std::vector<std::vector<float>> rows(SphereSeries::kRows);
  testing::for_each_density(solution.densities, [&](int, int y, int, float density) {
    rows[static_cast<std::size_t>(y)].push_back(density);
  });
  for (std::size_t y = 0; y + 1 < rows.size(); ++y) {
    for (std::size_t i = 0; i < rows[y].size(); ++i)
      steps[y] += static_cast<double>(std::abs(rows[y + 1][i] - rows[y][i]));
  }
  EXPECT_LT(steps[15], 1.5 * std::max(steps[14], steps[16]));
}

TEST_F(Tv, NonNegativityHoldsWhereItIsAskedFor) {
  const SphereSeries series;
  TvOptions o = options(30, 0.3);
  EXPECT_GE(testing::lowest(solve(testing::voxel_problem(series), o).densities), 0.0f);
  o.non_negative = false;
  EXPECT_LT(testing::lowest(solve(testing::voxel_problem(series), o).densities), -0.01f);
}

TEST_F(Tv, FittedScalesUndoTheGainsOfViews) {
  SphereSeries::Options gains;
  for (int view = 0; view < 31; ++view) gains.scale_of_view.push_back(view % 2 ? 0.7 : 1.3);
  const SphereSeries series(gains);
  VoxelProblem problem = testing::voxel_problem(series, {.fit_scale = true});
  const Solution solution =
      reconstruct_tv(problem, options(150, 1), 0.1, [](const auto&, const auto&) {});
  const Solution without = solve(testing::voxel_problem(series), options(150, 1));
  EXPECT_LT(solution.objective.back(), 0.5 * without.objective.back());
  EXPECT_NEAR(problem.view_model(14).scale / problem.view_model(15).scale, 1.3 / 0.7,
              0.2);  // the prior pulls the scales towards 1
}

// Steps of the rays' duals follow the scales: longer ones would let the objective diverge.
TEST_F(Tv, GreatGainsOfViewsStayFinite) {
  SphereSeries::Options gains;
  for (int view = 0; view < 31; ++view) gains.scale_of_view.push_back(view % 2 ? 0.2 : 5.0);
  SphereSeries series(gains);
  for (std::size_t view = 0; view < 31; ++view)
    series.noise_sigma[view] *= gains.scale_of_view[view];
  VoxelProblem problem = testing::voxel_problem(series, {.fit_scale = true});
  const Solution solution =
      reconstruct_tv(problem, options(120, 1), 0.1, [](const auto&, const auto&) {});
  EXPECT_LT(solution.objective.back(), 0.1 * solution.objective.front());
}

TEST_F(Tv, PixelsThatAreNoMeasurementsDoNotCount) {
  SphereSeries::Options hostile;
  hostile.masked_value = 1e6f;
  const SphereSeries series, masked(hostile);
  EXPECT_TRUE(testing::same_bits(solve(testing::voxel_problem(series), options(5, 3)).densities,
                                 solve(testing::voxel_problem(masked), options(5, 3)).densities));
}

TEST_F(Tv, ThreadsDoNotChangeABit) {
  const SphereSeries series;
  base::set_thread_count(1);
  const Solution one = solve(testing::voxel_problem(series), options(5, 3));
  base::set_thread_count(2);
  const Solution two = solve(testing::voxel_problem(series), options(5, 3));
  EXPECT_TRUE(testing::same_bits(one.densities, two.densities));
  EXPECT_EQ(one.objective, two.objective);
}

}  // namespace
}  // namespace tomofield::baseline
