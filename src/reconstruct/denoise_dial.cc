#include "reconstruct/denoise_dial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <set>

#include "reconstruct/trial_sections.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

struct Place {
  const char* name;
  double factor;
};
constexpr Place kPlaces[] = {{"light", 0.5}, {"medium", 1.0}, {"strong", 2.0}};
constexpr std::size_t kMediumPlace = 1;
constexpr double kLeastFactor = 0.05, kMostFactor = 20;

double log_distance(double weight, double wanted) { return std::abs(std::log(weight / wanted)); }

// Returns the trial with the chosen penalty and the first corrections whose weight is nearest to
// `weight`, or null if there is none.
const FitTrial* nearest_trial(const TunedFit& tuned, double weight) {
  const FitTrial* nearest = nullptr;
  for (const FitTrial& trial : tuned.trials) {
    if (trial.settings.penalty != tuned.settings.penalty || trial.settings.variation <= 0 ||
        !differs_from_first_in_variation_alone(trial, tuned))
      continue;
    if (!nearest || log_distance(trial.settings.variation, weight) <
                        log_distance(nearest->settings.variation, weight))
      nearest = &trial;
  }
  return nearest;
}

}  // namespace

double denoise_factor(const std::string& text) {
  for (const Place& place : kPlaces)
    if (text == place.name) return place.factor;
  char* end = nullptr;
  const double factor = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || *end != '\0' || !(factor >= kLeastFactor && factor <= kMostFactor))
    throw Error(fmt::format(
        "--denoise '{}' is no strength: give light, medium, strong, or a factor from {} to {}",
        text, kLeastFactor, kMostFactor));
  return factor;
}

std::vector<DialTrial> dial_trials(const TunedFit& tuned) {
  std::vector<DialTrial> found;
  std::set<const FitTrial*> different;
  for (const Place& place : kPlaces) {
    const FitTrial* const trial = nearest_trial(tuned, place.factor * tuned.settings.variation);
    if (trial == nullptr) return {};
    found.push_back({place.name, trial, trial->settings.variation / tuned.settings.variation});
    different.insert(trial);
  }
  if (different.size() < std::size(kPlaces)) return {};
  return found;
}

std::string caption_of(const DialTrial& shown) {
  const double of_place = denoise_factor(shown.place);
  const std::string factor = fmt::format("{:.2g}", shown.factor);
  if (factor == fmt::format("{:.2g}", of_place))
    return fmt::format("Factor {}: {}", factor, shown.place);
  return fmt::format("Factor {}: {} than {} ({:.2g})", factor,
                     shown.factor < of_place ? "lighter" : "stronger", shown.place, of_place);
}

void write_dial_picture(const TunedFit& tuned, double output_scale,
                        const std::filesystem::path& path) {
  std::vector<CaptionedSection> shown;
  for (const DialTrial& dial : dial_trials(tuned))
    shown.push_back({dial.trial->section, caption_of(dial)});
  draw_sections(shown, kMediumPlace, output_scale, path);
}

}  // namespace tomofield::reconstruction
