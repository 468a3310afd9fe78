#include "tune/tuning.h"

#include "objective/constants.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "base/threads/parallel.h"
#include "measurement/held_out.h"
#include "scratch_directory.h"
#include "sphere_series.h"
#include "tomofield/error.h"
#include "tune/trial_record.h"

namespace tomofield::tune {
namespace {

using testing::message_of;
using testing::SphereSeries;

// Errors of an imagined series: best at some weight, and better by `gain` a doubling of
// the rank and of the epochs, up to what is needed. Views differ from each other, not
// between trials, but for `scatter`.
struct ImaginedSeries {
  double best_variation = 10;
  int needed_rank = 16, needed_epochs = 30;
  double gain = 0.1, scatter = 0;
  double smooth_error = 0.05;  // more of a smooth penalty at its own best weight
  int num_trials = 0;

  FitTrial run(const TrialSettings& s) {
    ++num_trials;
    const bool is_smooth = s.penalty == Penalty::kSmooth;
    const double best = is_smooth ? best_variation * objective::usual_variation(Penalty::kSmooth) /
                                        objective::usual_variation(Penalty::kConcave)
                                  : best_variation;
    const double doublings = std::log2(s.variation / best);
    double error = 1 + (is_smooth ? smooth_error : 0) + 0.02 * doublings * doublings;
    error += gain * std::max(0.0, std::log2(static_cast<double>(needed_rank) / s.rank));
    error += gain * std::max(0.0, std::log2(static_cast<double>(needed_epochs) / s.epochs));
    FitTrial trial{s, {error, {}}};
    for (int view = 0; view < 12; ++view) {
      const double random = std::sin(1e3 * (view + 1) * (num_trials + 1));
      trial.score.view_error.push_back((1 + 0.3 * view) * error * (1 + scatter * random));
    }
    return trial;
  }
};

FitTrials trials_of(ImaginedSeries& series) {
  return make_trials([&](const std::vector<TrialSettings>& batch) {
    std::vector<FitTrial> trials;
    for (const TrialSettings& settings : batch) trials.push_back(series.run(settings));
    return trials;
  });
}

TrialSettings search(ImaginedSeries& series, std::vector<FitTrial>& trials,
                     const SearchSpace& space = {.penalty = false}) {
  FitTrials search_trials = trials_of(series);
  const TrialSettings found = search_settings({Penalty::kConcave, 9, 24, 30}, space, search_trials);
  trials = search_trials.made();
  return found;
}

TEST(SearchSettings, FindsTheWeightWithinAFactorOfRootTwo) {
  for (const double best : {0.2, 3.0, 9.0, 13.0, 100.0, 800.0}) {
    ImaginedSeries series{.best_variation = best};
    std::vector<FitTrial> trials;
    const TrialSettings found = search(series, trials);
    EXPECT_LE(std::abs(std::log2(found.variation / best)), 0.5) << best << " " << found.variation;
    std::set<std::tuple<double, int, int>> distinct;
    for (const FitTrial& t : trials)
      distinct.insert({t.settings.variation, t.settings.rank, t.settings.epochs});
    EXPECT_EQ(distinct.size(), trials.size()) << "tried twice";
    EXPECT_EQ(static_cast<int>(trials.size()), series.num_trials);
  }
}

TEST(SearchSettings, PaysForRankAndEpochsOnlyWhatHelps) {
  ImaginedSeries modest{.best_variation = 9, .needed_rank = 8, .needed_epochs = 15};
  ImaginedSeries demanding{.best_variation = 9, .needed_rank = 24, .needed_epochs = 60};
  std::vector<FitTrial> trials;
  TrialSettings found = search(modest, trials);
  EXPECT_EQ(std::pair(found.rank, found.epochs), std::pair(8, 15));
  trials.clear();
  found = search(demanding, trials);
  EXPECT_EQ(std::pair(found.rank, found.epochs), std::pair(24, 60));
  trials.clear();
  EXPECT_EQ(search(modest, trials, {.penalty = false, .rank = false}).rank, 24);
}

TEST(SearchSettings, TakesThePenaltyThatPredictsBetterAndItsOwnWeight) {
  for (const double smooth_error : {0.05, -0.05}) {
    ImaginedSeries series{.best_variation = 28, .smooth_error = smooth_error};
    std::vector<FitTrial> trials;
    const TrialSettings found = search(series, trials, {});
    EXPECT_EQ(found.penalty, smooth_error > 0 ? Penalty::kConcave : Penalty::kSmooth);
    EXPECT_NEAR(found.variation, smooth_error > 0 ? 28 : 10, 1e-9);
    FitTrials two = trials_of(series);
    EXPECT_EQ(choose_penalty({Penalty::kConcave, 3, 24, 30}, two).penalty, found.penalty);
    EXPECT_EQ(two.made().size(), 2u);
  }
}

TEST(SearchSettings, TakesTheSmoothestOfWhatCannotBeToldApart) {
  ImaginedSeries sure{.best_variation = 9}, unsure{.best_variation = 9, .scatter = 0.1};
  std::vector<FitTrial> trials, unsure_trials;
  EXPECT_NEAR(search(sure, trials).variation, 9, 1e-9);
  EXPECT_GT(search(unsure, unsure_trials).variation, 9 * 1.4);
}

// Makes trials of a small series and counts their steps.
class Tuning : public ::testing::Test {
 protected:
  Tuning() {
    field_.kind = FieldKind::kGrid;
    field_.leaf_size = 16;
    field_.with_margin = false;
    fit_.epochs = 2;
    fit_.subsets = 3;
    hooks_.stop_requested = [this] { return ++num_steps_ == stop_at_; };
  }

  TrialFile open(const char* fingerprint = "{}") const { return {file_, fingerprint, true}; }
  std::optional<TunedFit> tuned(TrialFile& file) {
    num_steps_ = 0;
    FitOptions thorough = fit_;
    thorough.tune = true;
    return choose_settings(measurement_, field_, thorough, {.variation = true}, &file, hooks_);
  }
  static FitTrial some_trial(double variation) {
    return {{Penalty::kSmooth, variation, 3, 4}, {1.5, {1.0, 2.0}}, 0.25};
  }

  SphereSeries series_;
  measurement::Measurement measurement_{.geometry = series_.geometry,
                                        .roi = {0, 0, SphereSeries::kWidth, SphereSeries::kRows},
                                        .rays = series_.rays,
                                        .noise_sigma = series_.noise_sigma,
                                        .mean_density = 0.1};
  FieldOptions field_;
  FitOptions fit_;
  TuneHooks hooks_;
  int num_steps_ = 0, stop_at_ = -1;
  testing::ScratchDirectory scratch_;
  std::filesystem::path file_ = scratch_ / "trials.json";
};

TEST_F(Tuning, RepeatsNoTrialOfTheFile) {
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

TEST_F(Tuning, KeepsTrialsThatWereFinishedBeforeAStop) {
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

TEST_F(Tuning, IsTheSameOnAnyNumberOfThreadsAndCallsFromItsOwn) {
  const std::thread::id here = std::this_thread::get_id();
  int num_reports = 0;
  double last_fraction = 0;
  hooks_.stop_requested = [&] {
    EXPECT_EQ(std::this_thread::get_id(), here);
    return false;
  };
  hooks_.progress = [&](const base::ProgressReport& report) {
    EXPECT_EQ(std::this_thread::get_id(), here);
    EXPECT_GE(report.fraction_done, last_fraction);
    last_fraction = report.fraction_done;
    ++num_reports;
  };
  const auto choice = [&](int threads) {
    base::set_thread_count(threads);
    last_fraction = 0;
    num_reports = 0;
    nlohmann::json json = tuning_json(
        *choose_settings(measurement_, field_, fit_, {.variation = true}, nullptr, hooks_));
    for (auto& trial : json["trials"]) trial.erase("seconds");
    base::set_thread_count(0);
    EXPECT_NEAR(last_fraction, 1, 1e-9);
    EXPECT_GE(num_reports, 2 * fit_.subsets);
    return json;
  };
  const nlohmann::json on_one = choice(1);
  ASSERT_GE(on_one["trials"].size(), 4u);
  EXPECT_EQ(choice(2), on_one);
  EXPECT_EQ(choice(3), on_one);
}

TEST_F(Tuning, AnExceptionOfTheProgressLeavesIt) {
  hooks_.progress = [](const base::ProgressReport&) { throw Error("enough"); };
  EXPECT_THROW(choose_settings(measurement_, field_, fit_, {.variation = true}, nullptr, hooks_),
               Error);
}

TEST_F(Tuning, DoesNotPredictTheViewsThatScoreTheResult) {
  measurement_.held_out = measurement::held_out_views(series_.geometry.tilt_deg, 4);
  const auto penalty =
      choose_settings(measurement_, field_, fit_, {.variation = true}, nullptr, hooks_);
  ASSERT_TRUE(penalty.has_value());
  EXPECT_FALSE(penalty->predicted_views.empty());
  for (const int view : penalty->predicted_views)
    EXPECT_EQ(std::ranges::count(measurement_.held_out, view), 0) << view;
}

TEST_F(Tuning, TriesBothPenalties) {
  const auto tuned =
      choose_settings(measurement_, field_, fit_, {.variation = true}, nullptr, hooks_);
  ASSERT_TRUE(tuned.has_value());
  const auto number_of = [&](Penalty penalty) {
    return std::ranges::count(tuned->trials, penalty,
                              [](const FitTrial& trial) { return trial.settings.penalty; });
  };
  EXPECT_GE(number_of(Penalty::kSmooth), 3);
  EXPECT_GE(number_of(Penalty::kConcave), 1);
  for (const FitTrial& trial : tuned->trials) EXPECT_FALSE(trial.score.patch_error.empty());
  EXPECT_EQ(tuned->settings.epochs, fit_.epochs);
}

TEST_F(Tuning, FindsATrialOfTheFileByAllOfItsSettings) {
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

TEST_F(Tuning, RefusesTrialsOfAnotherSeriesAndDamagedFiles) {
  TrialFile file = open();
  file.add(some_trial(2));
  const std::string other = message_of<Error>([&] { open("{1}"); });
  EXPECT_NE(other.find(file_.string()), std::string::npos) << other;
  EXPECT_NE(other.find("--overwrite"), std::string::npos) << other;
  const std::string text = testing::read_whole_file(file_);
  // Returns the file with another value for a key. What was its value follows a comma.
  const auto with = [&](const std::string& key, const std::string& value) {
    std::string changed = text;
    return changed.insert(changed.find(key) + key.size(), value + ", \"rest\": ");
  };
  for (const std::string& damaged :
       {text.substr(0, text.size() / 2), std::string("[]"), std::string(1 << 20, '['),
        with("\"held_out_error\": ", "null"), with("\"held_out_error\": ", "-1"),
        with("\"held_out_error_by_view\": ", "[1e300]"), with("\"seconds\": ", "\"long\"")}) {
    scratch_.write("trials.json", damaged);
    const std::string message = message_of<Error>([&] { open(); });
    EXPECT_NE(message.find("damaged"), std::string::npos) << message;
  }
}

TEST(TunedFit, ComesBackFromItsJson) {
  const TunedFit tuned{
      .settings = {Penalty::kConcave, 7.5, 12, 30, true, 0.25, true},
      .trials = {{{Penalty::kSmooth, 5, 12, 30}, {1.25, {1.0, 1.5}, {1.0, 1.5, 1.25}, 0.01}, 2.5}},
      .predicted_views = {3, 9}};
  const TunedFit read = tuned_from(nlohmann::json::parse(tuning_json(tuned).dump()));
  EXPECT_EQ(read.settings, tuned.settings);
  EXPECT_EQ(read.predicted_views, tuned.predicted_views);
  ASSERT_EQ(read.trials.size(), 1u);
  EXPECT_EQ(read.trials[0].score.patch_error, tuned.trials[0].score.patch_error);
  EXPECT_EQ(read.trials[0].settings, tuned.trials[0].settings);
  EXPECT_EQ(read.trials[0].score.error, 1.25);
  EXPECT_EQ(read.trials[0].score.speckle, 0.01);
  EXPECT_EQ(read.trials[0].score.face_jump, std::nullopt);
  EXPECT_EQ(read.trials[0].seconds, 2.5);
}

TEST(TunedFit, FindsTheTrialThatWasChosen) {
  TunedFit tuned{.settings = {Penalty::kSmooth, 5, 12, 10},
                 .trials = {{{Penalty::kConcave, 5, 12, 2}}, {{Penalty::kSmooth, 5, 12, 2}}},
                 .predicted_views = {3}};
  EXPECT_EQ(chosen_trial(tuned), &tuned.trials[1]);  // short trials have fewer epochs
  tuned.trials.push_back({{Penalty::kSmooth, 5 * (1 + 1e-12), 12, 10}});
  EXPECT_EQ(chosen_trial(tuned), &tuned.trials[2]);
  tuned.settings.rank = 6;
  EXPECT_EQ(chosen_trial(tuned), nullptr);
}

TEST(TunedFit, ImplausibleOnesAreRefused) {
  const TunedFit tuned{.settings = {Penalty::kConcave, 7.5, 12, 30},
                       .trials = {{{Penalty::kSmooth, 5, 12, 30}, {1.25, {1.0, 1.5}}, 2.5}},
                       .predicted_views = {3, 9}};
  const nlohmann::json good = tuning_json(tuned);
  const auto refusal = [&](const char* pointer, const nlohmann::json& value) {
    nlohmann::json changed = good;
    changed[nlohmann::json::json_pointer(pointer)] = value;
    return message_of<Error>([&] { tuned_from(changed); });
  };
  EXPECT_NE(refusal("/chosen/tv_penalty", "none").find("tv_penalty"), std::string::npos);
  EXPECT_NE(refusal("/chosen/tv", 1e300).find("tv"), std::string::npos);
  EXPECT_NE(refusal("/chosen/rank", 1e12).find("rank"), std::string::npos);
  EXPECT_NE(refusal("/chosen/epochs", -1).find("epochs"), std::string::npos);
  EXPECT_NE(refusal("/predicted_views/0", -1).find("predicted_views"), std::string::npos);
  EXPECT_NE(refusal("/trials/0/seconds", "long").find("seconds"), std::string::npos);
}

}  // namespace
}  // namespace tomofield::tune
