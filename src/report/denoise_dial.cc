#include "report/denoise_dial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>

#include "options/run_options.h"
#include "report/trial_sections.h"

namespace tomofield::report {
namespace {

constexpr std::size_t kMediumPlace = 1;

double log_distance(double weight, double wanted) { return std::abs(std::log(weight / wanted)); }

// Returns the trial with the chosen penalty and the first corrections whose weight is nearest to
// `weight`, or null if there is none.
const tune::FitTrial* nearest_trial(const tune::TunedFit& tuned, double weight) {
  const tune::FitTrial* nearest = nullptr;
  for (const tune::FitTrial& trial : tuned.trials) {
    if (trial.settings.penalty != tuned.settings.penalty || trial.settings.variation <= 0 ||
        !tune::differs_from_first_in_variation_alone(trial, tuned))
      continue;
    if (!nearest || log_distance(trial.settings.variation, weight) <
                        log_distance(nearest->settings.variation, weight))
      nearest = &trial;
  }
  return nearest;
}

}  // namespace

std::vector<DialTrial> dial_trials(const tune::TunedFit& tuned) {
  std::vector<DialTrial> found;
  std::set<const tune::FitTrial*> different;
  for (const options::DenoisePlace& place : options::kDenoisePlaces) {
    const tune::FitTrial* const trial =
        nearest_trial(tuned, place.factor * tuned.settings.variation);
    if (trial == nullptr) return {};
    found.push_back({place.name, trial, trial->settings.variation / tuned.settings.variation});
    different.insert(trial);
  }
  if (different.size() < std::size(options::kDenoisePlaces)) return {};
  return found;
}

std::string caption_of(const DialTrial& shown) {
  const double of_place = options::denoise_factor(shown.place);
  const std::string factor = fmt::format("{:.2g}", shown.factor);
  if (factor == fmt::format("{:.2g}", of_place))
    return fmt::format("Factor {}: {}", factor, shown.place);
  return fmt::format("Factor {}: {} than {} ({:.2g})", factor,
                     shown.factor < of_place ? "lighter" : "stronger", shown.place, of_place);
}

void write_dial_picture(const tune::TunedFit& tuned, double output_scale,
                        const std::filesystem::path& path) {
  std::vector<CaptionedSection> shown;
  for (const DialTrial& dial : dial_trials(tuned))
    shown.push_back({dial.trial->section, caption_of(dial)});
  draw_sections(shown, kMediumPlace, output_scale, path);
}

}  // namespace tomofield::report
