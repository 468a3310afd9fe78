#include "tune/automatic_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "objective/constants.h"
#include "tune/lowest_loss.h"

namespace tomofield::tune {
namespace {

// Neighbouring weights of the search. A factor of 1.8 from the best weight costs 0.05 to 0.3 dB on
// the yardsticks.
constexpr double kWeightFactor = 1.8;
// One step from the best smooth weight usually costs 1.5 % (the median of 48 runs of four
// specimens, which range from 0.6 to 2.5 %; docs/results/choice.md).
constexpr UsualCurvature kUsualCurvature{.loss_a_step = 0.016, .deviation = 0.016};
constexpr int kMostSteps = 3;  // to one side of the usual weight
// A concave penalty of less than its usual weight is not taken, so one step down is enough to see
// whether the usual one is needed.
constexpr int kMostStepsDownIfConcave = 1;
// A trial replaces the usual settings only if it predicts better by this part and by this number of
// standard errors. Trials are too short to tell smaller differences: a specimen took another
// penalty at each bin.
constexpr double kLeastGain = 0.01, kSureErrors = 3;

// The part of speckle that hardly anybody sees, and the face jump from which leaves show.
constexpr double kLittleSpeckle = 2e-4, kMostFaceJump = 1.1;

TrialSettings with_penalty(TrialSettings settings, Penalty penalty) {
  settings.penalty = penalty;
  settings.variation = objective::usual_variation(penalty);
  return settings;
}

TrialSettings with_factor(TrialSettings settings, double step) {
  settings.variation *= std::pow(kWeightFactor, step);
  return settings;
}

// Says whether the volume of `a` is clearly cleaner than that of `b`.
bool is_cleaner(const HeldOutScore& a, const HeldOutScore& b) {
  if (a.speckle && b.speckle && *b.speckle > kLittleSpeckle && *a.speckle < *b.speckle / 2)
    return true;
  return a.face_jump && b.face_jump && *b.face_jump > kMostFaceJump &&
         *a.face_jump <= kMostFaceJump;
}

// Says whether `a` predicts so much better than `b` that it may replace what is usual.
bool is_surely_better(const HeldOutScore& a, const HeldOutScore& b) {
  const Difference loss = difference(b, a);
  return loss.is_beyond(kSureErrors) && loss.log_ratio > kLeastGain;
}

// Trials of weights that are some steps of kWeightFactor from the usual one.
class Ladder {
 public:
  // `usual` has the usual weight. Goes up and down from there, until the best weight has a worse
  // one on either side, but at most `most_down` steps down.
  Ladder(const TrialSettings& usual, int most_down, FitTrials& trials)
      : usual_(usual), trials_(trials) {
    trials.make({usual, with_factor(usual, 1), with_factor(usual, -1)});
    while (highest_ < kMostSteps && error(highest_) < error(highest_ - 1)) ++highest_;
    while (-lowest_ < most_down && error(lowest_) < error(lowest_ + 1)) --lowest_;
  }

  TrialSettings at(double step) const { return with_factor(usual_, step); }
  HeldOutScore score(int step) const { return trials_.trial(at(step)).score; }
  int highest() const { return highest_; }

  int best() const {
    int best = lowest_;
    for (int step = lowest_; step <= highest_; ++step)
      if (error(step) < error(best)) best = step;
    return best;
  }

  // Returns the step, between those that were tried, at which a parabola through the scores of all
  // of them is lowest.
  double lowest() const {
    const HeldOutScore of_best = score(best());
    std::vector<LossAt> losses;
    for (int step = lowest_; step <= highest_; ++step) {
      const Difference loss = difference(score(step), of_best);
      losses.push_back({.place = static_cast<double>(step),
                        .loss = loss.log_ratio,
                        .standard_error = loss.standard_error});
    }
    return lowest_loss(losses, kUsualCurvature);
  }

 private:
  double error(int step) const { return difference(score(step), score(0)).log_ratio; }

  TrialSettings usual_;
  FitTrials& trials_;
  int highest_ = 1, lowest_ = -1;
};

TrialSettings choose_smooth_weight(const Ladder& ladder) {
  TrialSettings chosen = ladder.at(ladder.lowest());
  chosen.variation = std::stod(fmt::format("{:.3g}", chosen.variation));  // as users can give it
  return chosen;
}

// Says whether a smaller weight than the usual one predicts clearly worse.
bool needs_its_weight(const Ladder& ladder) {
  return difference(ladder.score(-1), ladder.score(0)).is_beyond(kClearErrors);
}

TrialSettings choose_concave_weight(const Ladder& ladder) {
  const HeldOutScore best = ladder.score(ladder.best());
  int chosen = is_surely_better(best, ladder.score(0)) ? ladder.best() : 0;
  for (int step = 0; step <= ladder.highest(); ++step) {
    if (!difference(ladder.score(step), best).is_beyond(kClearErrors) &&
        is_cleaner(ladder.score(step), ladder.score(chosen)))
      chosen = step;
  }
  return ladder.at(chosen);
}

// Returns the part of the background that is best to subtract: none, unless half of it is clearly
// better. The error grows with the square of what is left or too much, so the best part is at the
// vertex of the parabola through the three trials.
double best_background_part(const TrialSettings& start, FitTrials& trials) {
  std::vector<TrialSettings> candidates(2, start);
  candidates[1].background_part = 0.5;
  if (trials.first_as_good(candidates, kClearErrors).background_part == 0) return 0;
  const auto above_none = [&](double part) {
    TrialSettings settings = start;
    settings.background_part = part;
    trials.make({settings});
    return std::expm1(
        difference(trials.trial(settings).score, trials.trial(start).score).log_ratio);
  };
  const double half = above_none(0.5), all = above_none(1);
  const double curvature = all - 2 * half;
  if (curvature <= 0) return all < half ? 1.0 : 0.5;
  return std::clamp((all - 4 * half) / (4 * curvature), 0.0, 1.0);
}

}  // namespace

TrialSettings with_safe_corrections(TrialSettings settings, const OpenSettings& open) {
  settings.fits_view_scale = settings.fits_view_scale || open.view_scale;
  settings.masks_beads = settings.masks_beads || open.beads;
  return settings;
}

TrialSettings choose_penalty(const TrialSettings& start, FitTrials& trials) {
  const TrialSettings smooth = with_penalty(start, Penalty::kSmooth);
  const TrialSettings concave = with_penalty(start, Penalty::kConcave);
  trials.make({smooth, concave});
  return is_surely_better(trials.trial(concave).score, trials.trial(smooth).score) ? concave
                                                                                   : smooth;
}

TrialSettings choose_variation(const TrialSettings& start, FitTrials& trials) {
  const TrialSettings smooth = with_penalty(start, Penalty::kSmooth);
  const TrialSettings concave = with_penalty(start, Penalty::kConcave);
  trials.make({smooth, with_factor(smooth, 1), with_factor(smooth, -1), concave});
  const Ladder smooth_weights(smooth, kMostSteps, trials);
  if (!is_surely_better(trials.trial(concave).score, smooth_weights.score(smooth_weights.best())))
    return choose_smooth_weight(smooth_weights);
  const Ladder concave_weights(concave, kMostStepsDownIfConcave, trials);
  return needs_its_weight(concave_weights) ? choose_concave_weight(concave_weights)
                                           : choose_smooth_weight(smooth_weights);
}

TrialSettings choose_spike_rank(const TrialSettings& start, FitTrials& trials) {
  if (start.penalty != Penalty::kSmooth) return start;
  TrialSettings unlimited = start;
  unlimited.spike_rank = 0;
  trials.make({start, unlimited});
  return is_surely_better(trials.trial(unlimited).score, trials.trial(start).score) ? unlimited
                                                                                    : start;
}

TrialSettings choose_corrections(const TrialSettings& start, const OpenSettings& open,
                                 FitTrials& trials) {
  if (!open.view_scale && !open.background && !open.beads) return start;
  TrialSettings chosen = start;
  if (open.background) {
    // Offsets of views would hide the background from these trials.
    TrialSettings unscaled = start;
    unscaled.fits_view_scale = start.fits_view_scale && !open.view_scale;
    chosen.background_part = best_background_part(unscaled, trials);
  }
  TrialSettings unscaled = chosen, unmasked = chosen;
  if (open.view_scale) unscaled.fits_view_scale = false;
  if (open.beads) unmasked.masks_beads = false;
  trials.make({chosen, unscaled, unmasked});
  TrialSettings corrected = chosen;
  corrected.fits_view_scale =
      trials.first_as_good({unscaled, chosen}, kClearErrors).fits_view_scale;
  corrected.masks_beads = trials.first_as_good({chosen, unmasked}, kClearErrors).masks_beads;
  return corrected;
}

TrialSettings choose_prior(const TrialSettings& start, FitTrials& trials) {
  TrialSettings learned = start;
  learned.prior = Prior::kLearned;
  trials.make({start, learned});
  const Difference gain =
      difference_of_means(trials.trial(start).score, trials.trial(learned).score);
  return gain.log_ratio > -gain.standard_error ? learned : start;
}

int usual_trials(const OpenSettings& open) {
  const int corrections = open.view_scale + open.background + open.beads;
  if (open.variation) return 4 + open.spikes + corrections;
  return corrections > 0 ? 1 + corrections : 0;
}

}  // namespace tomofield::tune
