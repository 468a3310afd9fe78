#include "tune/automatic_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "tomofield/options.h"

namespace tomofield::tune {
namespace {

const TrialSettings kStart{Penalty::kConcave, 3, 24, 3, true, 0, true};

// The relative error of a trial with some settings.
using Error = std::function<double(const TrialSettings&)>;

// Makes trials of seven views that differ by what `error` says, and by `scatter` from view to view.
FitTrials trials_with(Error error, double scatter = 1e-3,
                      std::function<double(const TrialSettings&)> speckle = {}) {
  return make_trials([=, num_trials = 0](const std::vector<TrialSettings>& batch) mutable {
    std::vector<FitTrial> trials;
    for (const TrialSettings& settings : batch) {
      FitTrial trial{settings, {error(settings), {}}};
      ++num_trials;
      for (int view = 0; view < 7; ++view) {
        const double random = std::sin(1e3 * (view + 1) * num_trials);
        trial.score.view_error.push_back((1 + 0.2 * view) * error(settings) *
                                         (1 + scatter * random));
      }
      if (speckle) trial.score.speckle = speckle(settings);
      trials.push_back(std::move(trial));
    }
    return trials;
  });
}

// An error that grows with the distance from the best weight, and by `of_concave` with the concave
// penalty.
Error weights_error(double best_smooth, double best_concave, double of_concave) {
  return [=](const TrialSettings& s) {
    const bool is_smooth = s.penalty == Penalty::kSmooth;
    const double steps = std::log(s.variation / (is_smooth ? best_smooth : best_concave));
    return 1 + 0.05 * steps * steps + (is_smooth ? 0 : of_concave);
  };
}

TEST(ChoosePenalty, PrefersTheSmoothOneUnlessTheOtherIsSurelyBetter) {
  const auto chosen = [](double of_concave, double scatter) {
    FitTrials trials = trials_with(weights_error(5, 14, of_concave), scatter);
    return choose_penalty(kStart, trials).penalty;
  };
  EXPECT_EQ(chosen(-0.02, 1e-3), Penalty::kConcave);
  EXPECT_EQ(chosen(-0.02, 0.1), Penalty::kSmooth);    // within the errors
  EXPECT_EQ(chosen(-0.005, 1e-5), Penalty::kSmooth);  // sure, and too small to matter
}

TEST(ChooseVariation, FindsTheWeightOfTheSmoothPenaltyBetweenThoseThatAreTried) {
  for (const double best : {1.6, 2.2, 3.7, 5.0, 9.0, 16.0}) {
    FitTrials trials = trials_with(weights_error(best, 14, 0.5));
    const TrialSettings found = choose_variation(kStart, trials);
    EXPECT_EQ(found.penalty, Penalty::kSmooth);
    EXPECT_LT(std::abs(std::log(found.variation / best)), 0.1) << found.variation;
    EXPECT_LE(trials.made().size(), 6u);
  }
}

TEST(ChooseVariation, ChanceInTheScoresHardlyChangesTheSmoothWeight) {
  FitTrials trials = trials_with(weights_error(5, 14, 0.5), 0.02);
  EXPECT_LT(std::abs(std::log(choose_variation(kStart, trials).variation / 5)), std::log(1.3));
}

TEST(ChooseVariation, KeepsTheUsualConcaveWeightUnlessAnotherIsClearlyBetter) {
  FitTrials unsure = trials_with(weights_error(5, 20, -0.5), 0.05);
  EXPECT_EQ(choose_variation(kStart, unsure).variation, 14);
  FitTrials sure = trials_with(weights_error(5, 25, -0.5));
  EXPECT_NEAR(choose_variation(kStart, sure).variation, 14 * 1.8, 1e-9);
}

TEST(ChooseVariation, TakesNoConcavePenaltyThatASmallerWeightServesAsWell) {
  for (const double best : {6.0, 14 / std::sqrt(1.8)}) {
    FitTrials trials = trials_with(weights_error(5, best, -0.5));
    EXPECT_EQ(choose_variation(kStart, trials).penalty, Penalty::kSmooth) << best;
  }
}

TEST(ChooseVariation, PrefersAWeightThatIsAsGoodAndClearlyCleaner) {
  const auto speckle = [](const TrialSettings& s) { return s.variation > 20 ? 0.001 : 0.01; };
  FitTrials trials = trials_with(weights_error(5, 20, -0.5), 0.05, speckle);
  EXPECT_NEAR(choose_variation(kStart, trials).variation, 14 * 1.8, 1e-9);
}

TEST(ChooseSpikeRank, KeepsSpikesOnlyIfThatIsBetterByOnePerCent) {
  const auto chosen_if_kept_is = [](double error, Penalty penalty) {
    FitTrials trials =
        trials_with([=](const TrialSettings& s) { return s.spike_rank == 0 ? error : 1.0; }, 1e-4);
    TrialSettings start = kStart;
    start.penalty = penalty;
    return choose_spike_rank(start, trials).spike_rank;
  };
  EXPECT_EQ(chosen_if_kept_is(0.98, Penalty::kSmooth), 0);
  EXPECT_EQ(chosen_if_kept_is(0.995, Penalty::kSmooth), kStart.spike_rank);
  EXPECT_EQ(chosen_if_kept_is(1.02, Penalty::kSmooth), kStart.spike_rank);
  EXPECT_EQ(chosen_if_kept_is(0.9, Penalty::kConcave), kStart.spike_rank);
}

TEST(ChoosePrior, TakesTheLearnedOneIfItLowersTheErrorOfHeldOutViews) {
  const auto chosen_if_learned_is = [](double error) {
    FitTrials trials = trials_with(
        [=](const TrialSettings& s) { return s.prior == Prior::kLearned ? error : 1.0; }, 0);
    return choose_prior(kStart, trials).prior;
  };
  EXPECT_EQ(chosen_if_learned_is(0.999), Prior::kLearned);
  EXPECT_EQ(chosen_if_learned_is(1.001), Prior::kTv);
  EXPECT_EQ(chosen_if_learned_is(1.0), Prior::kTv);
}

TEST(ChooseCorrections, FitsScalesIfThatIsBetterAndMasksBeadsUnlessThatIsWorse) {
  const OpenSettings open{.view_scale = true, .beads = true};
  const auto scales_help = [](const TrialSettings& s) { return s.fits_view_scale ? 1.0 : 1.2; };
  FitTrials scales = trials_with(scales_help);
  TrialSettings chosen = choose_corrections(kStart, open, scales);
  EXPECT_TRUE(chosen.fits_view_scale);
  EXPECT_TRUE(chosen.masks_beads);
  const auto masks_harm = [](const TrialSettings& s) { return s.masks_beads ? 1.2 : 1.0; };
  FitTrials masks = trials_with(masks_harm);
  chosen = choose_corrections(kStart, open, masks);
  EXPECT_FALSE(chosen.fits_view_scale);
  EXPECT_FALSE(chosen.masks_beads);
  EXPECT_EQ(masks.made().size(), 3u);
}

TEST(ChooseCorrections, LeaveWhatIsNotOpenAsItIs) {
  FitTrials trials = trials_with([](const TrialSettings&) { return 1.0; });
  EXPECT_EQ(choose_corrections(kStart, {}, trials), kStart);
  EXPECT_TRUE(trials.made().empty());
}

TEST(ChooseCorrections, InterpolateThePartOfTheBackground) {
  const OpenSettings open{.view_scale = true, .background = true};
  for (const double best : {0.3, 0.5, 0.8, 1.0}) {
    FitTrials trials = trials_with([&](const TrialSettings& s) {
      const double left = s.background_part - best;
      return s.fits_view_scale ? 1.5 : 1 + left * left;
    });
    EXPECT_NEAR(choose_corrections(kStart, open, trials).background_part, best, 0.02);
  }
  FitTrials none =
      trials_with([](const TrialSettings& s) { return 1 + s.background_part * s.background_part; });
  EXPECT_EQ(choose_corrections(kStart, open, none).background_part, 0);
}

TEST(WithSafeCorrections, MakesThoseThatAreOpen) {
  const TrialSettings safe =
      with_safe_corrections({}, {.view_scale = true, .background = true, .beads = true});
  EXPECT_TRUE(safe.fits_view_scale);
  EXPECT_TRUE(safe.masks_beads);
  EXPECT_EQ(safe.background_part, 0);
  EXPECT_EQ(with_safe_corrections({}, {}), TrialSettings{});
}

}  // namespace
}  // namespace tomofield::tune
