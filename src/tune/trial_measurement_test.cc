#include "tune/trial_measurement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "measurement/held_out.h"
#include "scratch_directory.h"
#include "sphere_series.h"
#include "tomofield/error.h"

namespace tomofield::tune {
namespace {

using testing::SphereSeries;

TEST(TrialViews, AreNoneOfThoseThatScoreTheResult) {
  const std::vector<double> tilts = SphereSeries().geometry.tilt_deg;
  for (const int every : {2, 4, 8, 9}) {
    const std::vector<int> scored = measurement::held_out_views(tilts, every);
    const TrialViews trial = trial_views(tilts, scored);
    std::vector<int> all(scored);
    all.insert(all.end(), trial.fitted_or_predicted.begin(), trial.fitted_or_predicted.end());
    std::ranges::sort(all);
    ASSERT_EQ(all.size(), tilts.size()) << every;
    EXPECT_EQ(std::ranges::adjacent_find(all), all.end()) << "a view is in both";
    EXPECT_FALSE(trial.predicted.empty());
    EXPECT_TRUE(std::ranges::includes(trial.fitted_or_predicted, trial.predicted));
  }
}

TEST(TrialViews, PredictEveryEighthOrAboutFive) {
  const auto predicted = [](int num_views) {
    std::vector<double> tilts;
    for (int v = 0; v < num_views; ++v) tilts.push_back(v);
    return trial_views(tilts, {}).predicted;
  };
  EXPECT_EQ(predicted(50), (std::vector<int>{4, 12, 20, 28, 36, 44}));
  EXPECT_EQ(predicted(31), (std::vector<int>{3, 9, 15, 21, 27}));
  EXPECT_EQ(predicted(14), (std::vector<int>{1, 4, 7, 10}));
  EXPECT_EQ(predicted(6), (std::vector<int>{1, 4}));
}

TEST(TrialViews, OfTooFewThereAreNone) {
  const std::string message = testing::message_of<Error>([] {
    trial_views({-50, -30, -10, 10, 30, 50}, {2});
  });
  EXPECT_NE(message.find("5 views"), std::string::npos) << message;
  EXPECT_NE(message.find("--hold-out"), std::string::npos) << message;
}

TEST(TrialMeasurement, HasTheRaysOfItsViews) {
  const SphereSeries spheres;
  measurement::Measurement whole{.geometry = spheres.geometry,
                                 .roi = {2, 5, 30, 5 + SphereSeries::kRows},
                                 .rays = spheres.rays};
  for (int v = 0; v < 31; ++v) whole.noise_sigma.push_back(1.0 + v);
  whole.mean_density = 0.25;
  whole.held_out = {3, 12};
  const TrialViews views = trial_views(whole.geometry.tilt_deg, whole.held_out);
  const measurement::Measurement trial = trial_measurement(whole, views, 16);
  ASSERT_EQ(trial.rays->shape().num_views, 29u);
  ASSERT_EQ(trial.rays->shape().num_rows, 16);
  const std::int64_t first = (SphereSeries::kRows - 16) / 2;
  EXPECT_EQ(trial.roi.x0, 2);
  EXPECT_EQ(trial.roi.y0, 5 + first);
  EXPECT_EQ(trial.roi.height(), 16);
  EXPECT_EQ(trial.mean_density, 0.25);
  for (std::size_t v = 0; v < 29; ++v) {
    const int from = views.fitted_or_predicted[v];
    EXPECT_EQ(trial.geometry.tilt_deg[v], whole.geometry.tilt_deg[static_cast<std::size_t>(from)]);
    EXPECT_EQ(trial.noise_sigma[v], 1.0 + from);
    for (std::int64_t x = 0; x < SphereSeries::kWidth; ++x) {
      ASSERT_EQ(trial.rays->counts(static_cast<int>(v), x, 7),
                whole.rays->counts(from, x, 7 + first));
      ASSERT_EQ(trial.rays->ray(static_cast<int>(v), x, 7), whole.rays->ray(from, x, 7 + first));
    }
  }
  ASSERT_EQ(trial.held_out.size(), views.predicted.size());
  for (std::size_t i = 0; i < trial.held_out.size(); ++i) {
    const auto at = static_cast<std::size_t>(trial.held_out[i]);
    EXPECT_EQ(views.fitted_or_predicted[at], views.predicted[i]);
  }
}

}  // namespace
}  // namespace tomofield::tune
