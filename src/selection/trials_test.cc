#include "selection/trials.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "measurement/held_out.h"
#include "scratch_directory.h"
#include "sphere_series.h"
#include "tomofield/error.h"

namespace tomofield::selection {
namespace {

using testing::message_of;
using testing::SphereSeries;

// Makes trials of a small series and counts their steps.
class Trials : public ::testing::Test {
 protected:
  Trials() {
    field_.kind = FieldKind::kGrid;
    field_.leaf_size = 16;
    field_.with_margin = false;
    fit_.epochs = 2;
    fit_.subsets = 3;
    hooks_.stop_requested = [this] { return ++num_steps_ == stop_at_; };
  }

  TrialFile open(const char* fingerprint = "{}") const { return {file_, fingerprint, true}; }
  std::optional<Tuned> tuned(TrialFile& file) {
    num_steps_ = 0;
    return tune(measurement_, field_, fit_, true, file, hooks_);
  }
  static Trial some_trial(double variation) {
    return {{Penalty::kSmooth, variation, 3, 4}, {1.5, {1.0, 2.0}}, 0.25};
  }

  SphereSeries series_;
  measurement::Measurement measurement_{.geometry = series_.geometry,
                                        .roi = {0, 0, SphereSeries::kWidth, SphereSeries::kRows},
                                        .rays = series_.rays,
                                        .noise_sigma = series_.noise_sigma,
                                        .mean_density = 0.1};
  fit::FieldOptions field_;
  fit::FitOptions fit_;
  TuneHooks hooks_;
  int num_steps_ = 0, stop_at_ = -1;
  testing::ScratchDirectory scratch_;
  std::filesystem::path file_ = scratch_ / "trials.json";
};

TEST_F(Trials, OfTheFileAreNotRepeated) {
  TrialFile file = open();
  const auto first = tuned(file);
  ASSERT_TRUE(first.has_value());
  const int all_steps = num_steps_;
  EXPECT_GE(all_steps, static_cast<int>(first->trials.size()));
  TrialFile same = open();
  const auto second = tuned(same);
  EXPECT_EQ(num_steps_, 0) << "a trial was made again";
  EXPECT_EQ(tuning_json(*second), tuning_json(*first));

  // A file without the last trial.
  std::filesystem::remove(file_);
  TrialFile part = open();
  for (std::size_t i = 0; i + 1 < first->trials.size(); ++i) part.add(first->trials[i]);
  TrialFile rest = open();
  const auto third = tuned(rest);
  EXPECT_GT(num_steps_, 0);
  EXPECT_LT(num_steps_, all_steps / 2);
  EXPECT_EQ(third->settings, first->settings);
  EXPECT_EQ(third->trials.back().score.view_error, first->trials.back().score.view_error);
}

TEST_F(Trials, ThatWereFinishedBeforeAStopAreKept) {
  TrialFile whole = open();
  const auto undisturbed = tuned(whole);
  const int all_steps = num_steps_;
  std::filesystem::remove(file_);
  TrialFile file = open();
  stop_at_ = all_steps / 2;
  EXPECT_FALSE(tuned(file).has_value());
  stop_at_ = -1;
  TrialFile again = open();
  const auto resumed = tuned(again);
  ASSERT_TRUE(resumed.has_value());
  EXPECT_GT(num_steps_, 0);
  EXPECT_LT(num_steps_, all_steps);
  EXPECT_EQ(resumed->settings, undisturbed->settings);
}

TEST_F(Trials, DoNotPredictTheViewsThatScoreTheResult) {
  measurement_.held_out = measurement::held_out_views(series_.geometry.tilt_deg, 4);
  const auto penalty = tune_penalty(measurement_, field_, fit_, hooks_);
  ASSERT_TRUE(penalty.has_value());
  EXPECT_FALSE(penalty->predicted_views.empty());
  for (const int view : penalty->predicted_views)
    EXPECT_EQ(std::ranges::count(measurement_.held_out, view), 0) << view;
}

TEST_F(Trials, OfThePenaltyAreOneOfEachAndTheBetterWins) {
  const auto tuned = tune_penalty(measurement_, field_, fit_, hooks_);
  ASSERT_TRUE(tuned.has_value());
  ASSERT_EQ(tuned->trials.size(), 2u);
  const Trial& one = tuned->trials[0];
  const Trial& other = tuned->trials[1];
  EXPECT_NE(one.settings.penalty, other.settings.penalty);
  const bool prefers_one = most_views_prefer(one.score, other.score);
  const bool prefers_other = most_views_prefer(other.score, one.score);
  ASSERT_NE(prefers_one, prefers_other) << "this series has an odd number of predicted views";
  EXPECT_EQ(tuned->settings.penalty, (prefers_one ? one : other).settings.penalty);
  EXPECT_EQ(tuned->settings.epochs, fit_.epochs);
}

TEST_F(Trials, TheFileFindsATrialByAllOfItsSettings) {
  TrialFile file = open();
  EXPECT_FALSE(file.find(some_trial(2).settings).has_value());
  file.add(some_trial(2));
  file.add(some_trial(4));
  const TrialFile read = open();
  const auto found = read.find(some_trial(4).settings);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->score.view_error, some_trial(4).score.view_error);
  EXPECT_EQ(found->seconds, 0.25);
  for (const TrialSettings& other :
       {TrialSettings{Penalty::kConcave, 4, 3, 4}, TrialSettings{Penalty::kSmooth, 5, 3, 4},
        TrialSettings{Penalty::kSmooth, 4, 2, 4}, TrialSettings{Penalty::kSmooth, 4, 3, 5}})
    EXPECT_FALSE(read.find(other).has_value());
  const TrialFile fresh(file_, "{}", false);
  EXPECT_FALSE(fresh.find(some_trial(4).settings).has_value()) << "trials were not to be reused";
}

TEST_F(Trials, OfAnotherSeriesOrInADamagedFileAreRefused) {
  TrialFile file = open();
  file.add(some_trial(2));
  const std::string other = message_of<Error>([&] { open("{1}"); });
  EXPECT_NE(other.find(file_.string()), std::string::npos) << other;
  EXPECT_NE(other.find("--overwrite"), std::string::npos) << other;
  const std::string text = testing::read_whole_file(file_);
  for (const std::string& damaged : {text.substr(0, text.size() / 2), std::string("[]")}) {
    scratch_.write("trials.json", damaged);
    const std::string message = message_of<Error>([&] { open(); });
    EXPECT_NE(message.find("damaged"), std::string::npos) << message;
  }
}

TEST(Tuned, ComesBackFromItsJson) {
  const Tuned tuned{.settings = {Penalty::kConcave, 7.5, 12, 30},
                    .trials = {{{Penalty::kSmooth, 5, 12, 30}, {1.25, {1.0, 1.5}}, 2.5}},
                    .predicted_views = {3, 9}};
  const Tuned read = tuned_from(nlohmann::json::parse(tuning_json(tuned).dump()));
  EXPECT_EQ(read.settings, tuned.settings);
  EXPECT_EQ(read.predicted_views, tuned.predicted_views);
  ASSERT_EQ(read.trials.size(), 1u);
  EXPECT_EQ(read.trials[0].settings, tuned.trials[0].settings);
  EXPECT_EQ(read.trials[0].score.error, 1.25);
  EXPECT_EQ(read.trials[0].seconds, 2.5);
}

}  // namespace
}  // namespace tomofield::selection
