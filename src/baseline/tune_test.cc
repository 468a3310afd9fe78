#include "baseline/tune.h"

#include <gtest/gtest.h>

#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "measurement/held_out.h"
#include "voxel_comparison.h"

namespace tomofield::baseline {
namespace {

using testing::SphereSeries;

class BaselineTune : public testing::OneThread {
 protected:
  BaselineTune() { use({}); }

  void use(const SphereSeries::Options& options) {
    SphereSeries spheres(options);
    series_.geometry = spheres.geometry;
    series_.roi = {0, 0, SphereSeries::kWidth, SphereSeries::kRows};
    series_.noise_sigma = spheres.noise_sigma;
    series_.rays = spheres.rays;
    series_.mean_density = 0.1;
  }

  Tuned tuned(const Method& start) const {
    const projection::SampleGrid grid =
        projection::make_sample_grid(series_.geometry, 0, SphereSeries::kWidth, 0);
    return tune(start, {series_, grid, {}, false}, progress_);
  }

  // Returns the root mean square distance between the truth and the result of all views.
  double error_of(const Method& method) const {
    VoxelProblem problem(series_.geometry,
                         projection::make_sample_grid(series_.geometry, 0, SphereSeries::kWidth, 0),
                         *series_.rays, series_.noise_sigma);
    return testing::rms_error(
        reconstruct(problem, method, series_.mean_density, [](const IterationReport&, auto&) {
        }).densities);
  }

  measurement::Measurement series_;
  base::ProgressSink progress_;
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
    const TvOptions& chosen = std::get<TvOptions>(found.settings);
    EXPECT_GT(*chosen.weight, 0.3) << start;
    EXPECT_LT(*chosen.weight, 20) << start;
    EXPECT_LT(error_of(chosen), 0.8 * error_of(tv(start))) << start;
    EXPECT_EQ(chosen.penalty, std::nullopt) << "a weight belongs to its penalty";
    std::set<std::pair<double, int>> weights;
    for (const Trial& t : found.trials) {
      const auto& options = std::get<TvOptions>(t.settings);
      weights.emplace(*options.weight, options.iterations);
      EXPECT_EQ(t.score.view_error.size(), 5u);
    }
    EXPECT_EQ(weights.size(), found.trials.size()) << "tried twice";
  }
}

TEST_F(BaselineTune, TriesBothPenaltiesIfNothingIsSaid) {
  const Tuned found = tuned(tv({}));
  EXPECT_EQ(std::get<TvOptions>(found.trials[0].settings).penalty, Penalty::kConcave);
  EXPECT_EQ(std::get<TvOptions>(found.trials[1].settings).penalty, Penalty::kSmooth);
  const bool votes_smooth = tune::most_views_prefer(found.trials[1].score, found.trials[0].score);
  EXPECT_EQ(std::get<TvOptions>(found.settings).penalty,
            votes_smooth ? Penalty::kSmooth : Penalty::kConcave);
  TvOptions concave = tv({});
  concave.penalty = Penalty::kConcave;
  EXPECT_EQ(std::get<TvOptions>(tuned(concave).settings).penalty, Penalty::kConcave);
}

TEST_F(BaselineTune, IsNotMisledByIterationsThatAreTooFew) {
  TvOptions few = tv({}), many = tv({});
  few.penalty = many.penalty = Penalty::kSmooth;
  few.iterations = 5;
  many.iterations = 200;
  const Tuned with_few = tuned(few), with_many = tuned(many);
  EXPECT_EQ(std::get<TvOptions>(with_few.settings).iterations, 5);
  EXPECT_EQ(std::get<TvOptions>(with_few.trials.front().settings).iterations, 5);
  EXPECT_GE(std::get<TvOptions>(with_few.trials.back().settings).iterations, 20);
  EXPECT_EQ(std::get<TvOptions>(with_many.trials.back().settings).iterations, 200);
  const double ratio = *std::get<TvOptions>(with_few.settings).weight /
                       *std::get<TvOptions>(with_many.settings).weight;
  EXPECT_GT(ratio, 0.6);
  EXPECT_LT(ratio, 1.7);
}

TEST_F(BaselineTune, StopsBeforeTheNoiseIsFitted) {
  SirtOptions options;
  options.iterations = 300;
  const Tuned found = tuned(options);
  EXPECT_LT(std::get<SirtOptions>(found.settings).iterations, 300);
  EXPECT_LT(error_of(found.settings), error_of(options));
}

TEST_F(BaselineTune, AStopIsTheSameAsARunOfSoManyIterations) {
  SirtOptions options;
  options.iterations = 8;
  const Tuned all = tuned(options);
  ASSERT_EQ(all.trials.size(), 9u);
  options.iterations = 2;  // its longest run has 8 iterations
  const Tuned few = tuned(options);
  EXPECT_EQ(std::get<SirtOptions>(all.trials[4].settings).iterations, 8);
  EXPECT_EQ(std::get<SirtOptions>(few.trials.back().settings).iterations, 8);
  EXPECT_EQ(all.trials[4].score.view_error, few.trials.back().score.view_error);
}

TEST_F(BaselineTune, CutsOffWhereNoiseIsAllThereIs) {
  SphereSeries::Options noisy;
  noisy.noise_sigma = 3;
  use(noisy);
  const WbpOptions start;
  const Tuned found = tuned(start);
  ASSERT_EQ(found.trials.size(), 7u);
  EXPECT_NEAR(std::get<WbpOptions>(found.trials.front().settings).filter.cutoff,
              start.filter.cutoff / 8, 1e-9);
  const double chosen = std::get<WbpOptions>(found.settings).filter.cutoff;
  EXPECT_LT(chosen, start.filter.cutoff);
  EXPECT_GT(chosen, start.filter.cutoff / 8);
  EXPECT_LT(error_of(found.settings), error_of(start));
}

// A search does not know in advance how many weights it tries; the progress assumes the usual
// number.
TEST_F(BaselineTune, TellsHowFarItIs) {
  TvOptions concave = tv(3.0);
  concave.iterations = 120;
  const std::vector<std::pair<Method, std::string>> cases{{SirtOptions{.iterations = 20}, "1/1"},
                                                          {SartTvOptions{.iterations = 8}, "/8"},
                                                          {concave, "/7"},
                                                          {WbpOptions{}, "7/7"}};
  for (const auto& [method, last] : cases) {
    std::vector<base::ProgressReport> reports;
    progress_ = [&](const base::ProgressReport& report) { reports.push_back(report); };
    tuned(method);
    const char* name = facts_of(method).name;
    EXPECT_LT(reports.front().fraction_done, 0.2) << name;
    for (std::size_t i = 1; i < reports.size(); ++i)
      ASSERT_GE(reports[i].fraction_done, reports[i - 1].fraction_done) << name << i;
    EXPECT_NEAR(reports.back().fraction_done, 1, 0.1) << name;
    EXPECT_NE(reports.back().detail.find(last), std::string::npos) << reports.back().detail;
  }
}

TEST_F(BaselineTune, LeavesAMethodAloneThatHasNothingToChoose) {
  EXPECT_TRUE(tuned(IngpOptions{}).trials.empty());
}

}  // namespace
}  // namespace tomofield::baseline
