#include "baseline/tune.h"

#include <gtest/gtest.h>

#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "reconstruct/held_out.h"
#include "voxel_comparison.h"

namespace tomofield::baseline {
namespace {

using testing::SphereSeries;

class BaselineTune : public testing::OneThread {
 protected:
  BaselineTune() {
    SphereSeries spheres;
    series_.geometry = spheres.geometry;
    series_.roi = {0, 0, SphereSeries::kWidth, SphereSeries::kRows};
    series_.noise_sigma = spheres.noise_sigma;
    series_.rays = std::move(spheres.rays);
    series_.mean_density = 0.1;
  }

  Tuned tuned(const Method& start) const {
    const projection::SampleGrid grid =
        projection::make_sample_grid(series_.geometry, 0, SphereSeries::kWidth, 0);
    return tune(start, {series_, grid, {}, false}, {});
  }

  // Root mean square distance to the truth of what all views give.
  double error_of(const Method& method) const {
    VoxelProblem problem = testing::voxel_problem(spheres_);
    return testing::rms_error(
        reconstruct(problem, method, series_.mean_density, [](const IterationReport&, auto&) {
        }).densities);
  }

  SphereSeries spheres_;
  reconstruct::PreparedSeries series_;
};

TvOptions tv(std::optional<double> weight) {
  TvOptions options;
  options.iterations = 30;
  options.weight = weight;
  return options;
}

TEST_F(BaselineTune, FindsABetterWeightFromEitherEnd) {
  for (const double start : {0.02, 200.0}) {
    const Tuned found = tuned(tv(start));
    const TvOptions& chosen = std::get<TvOptions>(found.method);
    EXPECT_GT(*chosen.weight, 0.3) << start;
    EXPECT_LT(*chosen.weight, 20) << start;
    EXPECT_LT(error_of(chosen), 0.8 * error_of(tv(start))) << start;
    EXPECT_EQ(chosen.penalty, std::nullopt) << "a weight belongs to its penalty";
    std::set<std::pair<double, int>> weights;
    for (const Trial& t : found.trials) {
      const auto& options = std::get<TvOptions>(t.method);
      weights.emplace(*options.weight, options.iterations);
      EXPECT_EQ(t.score.view_error.size(), 5u);
    }
    EXPECT_EQ(weights.size(), found.trials.size()) << "tried twice";
  }
}

TEST_F(BaselineTune, TriesBothPenaltiesIfNothingIsSaid) {
  const Tuned found = tuned(tv({}));
  EXPECT_EQ(std::get<TvOptions>(found.trials[0].method).penalty, "concave");
  EXPECT_EQ(std::get<TvOptions>(found.trials[1].method).penalty, "smooth");
  const bool votes_smooth =
      reconstruct::most_views_prefer(found.trials[1].score, found.trials[0].score);
  EXPECT_EQ(std::get<TvOptions>(found.method).penalty, votes_smooth ? "smooth" : "concave");
  TvOptions concave = tv({});
  concave.penalty = "concave";
  EXPECT_EQ(std::get<TvOptions>(tuned(concave).method).penalty, "concave");
}

TEST_F(BaselineTune, IsNotMisledByIterationsThatAreTooFew) {
  TvOptions few = tv({}), many = tv({});
  few.penalty = many.penalty = "smooth";
  few.iterations = 5;
  many.iterations = 200;
  const Tuned with_few = tuned(few), with_many = tuned(many);
  EXPECT_EQ(std::get<TvOptions>(with_few.method).iterations, 5);
  EXPECT_EQ(std::get<TvOptions>(with_few.trials.front().method).iterations, 5);
  EXPECT_GE(std::get<TvOptions>(with_few.trials.back().method).iterations, 20);
  EXPECT_EQ(std::get<TvOptions>(with_many.trials.back().method).iterations, 200);
  const double ratio =
      *std::get<TvOptions>(with_few.method).weight / *std::get<TvOptions>(with_many.method).weight;
  EXPECT_GT(ratio, 0.6);
  EXPECT_LT(ratio, 1.7);
}

TEST_F(BaselineTune, StopsBeforeTheNoiseIsFitted) {
  SirtOptions options;
  options.iterations = 300;
  const Tuned found = tuned(options);
  EXPECT_LT(std::get<SirtOptions>(found.method).iterations, 300);
  EXPECT_LT(error_of(found.method), error_of(options));
}

TEST_F(BaselineTune, AStopIsTheSameAsARunOfSoManyIterations) {
  SirtOptions options;
  options.iterations = 8;
  const Tuned all = tuned(options);
  ASSERT_EQ(all.trials.size(), 9u);
  options.iterations = 2;  // its longest run is a trial of the other's
  const Tuned few = tuned(options);
  EXPECT_EQ(std::get<SirtOptions>(all.trials[4].method).iterations, 8);
  EXPECT_EQ(std::get<SirtOptions>(few.trials.back().method).iterations, 8);
  EXPECT_EQ(all.trials[4].score.view_error, few.trials.back().score.view_error);
}

TEST_F(BaselineTune, LeavesAMethodAloneThatHasNothingToChoose) {
  EXPECT_TRUE(tuned(WbpOptions{}).trials.empty());
}

}  // namespace
}  // namespace tomofield::baseline
