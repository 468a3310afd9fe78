#include "reconstruct/automatic_choice.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "objective/options.h"

namespace tomofield::reconstruction {
namespace {

// Neighbouring weights of the search. A factor of 1.8 from the best weight costs 0.05 to 0.3 dB on
// the yardsticks.
constexpr double kWeightFactor = 1.8;
constexpr int kMostSteps = 3;  // to one side of the usual weight
// A concave penalty of a smaller weight leaves isolated voxels, whatever the held-out views say.
constexpr int kMostStepsDownIfConcave = 1;
// Another concave weight than the usual one, and a fit without a limit of isolated vertices, must
// predict better by this part. Trials are too short to tell smaller differences: those of the
// yardsticks prefer a larger weight by up to 0.5 %.
constexpr double kLeastGain = 0.01;

// The part of speckle that hardly anybody sees, and the face jump from which leaves show.
constexpr double kLittleSpeckle = 2e-4, kMostFaceJump = 1.1;

TrialSettings with_penalty(TrialSettings settings, Penalty penalty) {
  settings.penalty = penalty;
  settings.variation = objective::usual_variation(penalty);
  return settings;
}

TrialSettings with_factor(TrialSettings settings, int step) {
  settings.variation *= std::pow(kWeightFactor, step);
  return settings;
}

// Says whether the volume of `a` is clearly cleaner than that of `b`.
bool is_cleaner(const selection::HeldOutScore& a, const selection::HeldOutScore& b) {
  if (a.speckle && b.speckle && *b.speckle > kLittleSpeckle && *a.speckle < *b.speckle / 2)
    return true;
  return a.face_jump && b.face_jump && *b.face_jump > kMostFaceJump &&
         *a.face_jump <= kMostFaceJump;
}

// Returns the steps of the weight from the best one on, in order of preference.
std::vector<int> preferred_steps(Penalty penalty, int lowest, int highest) {
  std::vector<int> steps;
  for (int step = highest; step >= lowest; --step) steps.push_back(step);
  if (penalty == Penalty::kConcave)
    std::ranges::stable_sort(steps, {}, [](int step) { return std::abs(step); });
  return steps;
}

// Chooses the weight of the penalty of `usual`, which has the usual weight.
TrialSettings choose_weight(const TrialSettings& usual, FitTrials& trials) {
  trials.make({usual, with_factor(usual, 1), with_factor(usual, -1)});
  const auto is_better = [&](int a, int b) {
    return selection::difference(trials.trial(with_factor(usual, a)).score,
                                 trials.trial(with_factor(usual, b)).score)
               .log_ratio < 0;
  };
  int highest = 1, lowest = -1;
  while (highest < kMostSteps && is_better(highest, highest - 1)) ++highest;
  const int most_down = usual.penalty == Penalty::kConcave ? kMostStepsDownIfConcave : kMostSteps;
  while (-lowest < most_down && is_better(lowest, lowest + 1)) --lowest;
  std::vector<TrialSettings> candidates;
  for (const int step : preferred_steps(usual.penalty, lowest, highest))
    candidates.push_back(with_factor(usual, step));
  const std::vector<TrialSettings> good = trials.as_good(candidates, kClearErrors);
  TrialSettings chosen = good.front();
  if (usual.penalty == Penalty::kConcave &&
      selection::difference(trials.trial(usual).score, trials.trial(chosen).score).log_ratio <
          kLeastGain)
    chosen = usual;
  for (const TrialSettings& other : good)
    if (is_cleaner(trials.trial(other).score, trials.trial(chosen).score)) chosen = other;
  return chosen;
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
        selection::difference(trials.trial(settings).score, trials.trial(start).score).log_ratio);
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
  return trials.first_as_good(
      {with_penalty(start, Penalty::kSmooth), with_penalty(start, Penalty::kConcave)},
      kClearErrors);
}

TrialSettings choose_variation(const TrialSettings& start, FitTrials& trials) {
  return choose_weight(choose_penalty(start, trials), trials);
}

TrialSettings choose_spike_rank(const TrialSettings& start, FitTrials& trials) {
  if (start.penalty != Penalty::kSmooth) return start;
  TrialSettings unlimited = start;
  unlimited.spike_rank = 0;
  trials.make({start, unlimited});
  const selection::Difference loss =
      selection::difference(trials.trial(start).score, trials.trial(unlimited).score);
  return loss.is_beyond(kClearErrors) && loss.log_ratio > kLeastGain ? unlimited : start;
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

int usual_trials(const OpenSettings& open) {
  const int corrections = open.view_scale + open.background + open.beads;
  if (open.variation) return 4 + open.spikes + corrections;
  return corrections > 0 ? 1 + corrections : 0;
}

}  // namespace tomofield::reconstruction
