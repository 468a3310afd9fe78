#include "reconstruct/denoise_dial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <set>
#include <system_error>
#include <utility>

#include "report/canvas.h"
#include "report/contrast.h"
#include "report/slice.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

struct Place {
  const char* name;
  double factor;
};
constexpr Place kPlaces[] = {{"light", 0.5}, {"medium", 1.0}, {"strong", 2.0}};
constexpr double kLeastFactor = 0.05, kMostFactor = 20;

constexpr std::int64_t kCaption_px = 28;  // height of the caption above a section
constexpr std::int64_t kTextAboveSection_px = 6;
constexpr report::Colour kWhite{255, 255, 255}, kBlack{0, 0, 0};

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

// Draws a section with its caption above it; `bottom` is the row of its lower edge.
void draw_section(const DialTrial& shown, double output_scale, const report::GreyScale& scale,
                  std::int64_t zoom, std::int64_t bottom, report::Canvas& canvas) {
  const selection::Section& section = shown.trial->section;
  const auto height = std::ssize(section.values) / section.width;
  for (std::int64_t y = 0; y < height; ++y) {
    for (std::int64_t x = 0; x < section.width; ++x) {
      const std::uint8_t grey = scale.grey(
          output_scale *
          static_cast<double>(section.values[static_cast<std::size_t>(y * section.width + x)]));
      canvas.fill(x * zoom, bottom + y * zoom, (x + 1) * zoom, bottom + (y + 1) * zoom,
                  {grey, grey, grey});
    }
  }
  report::draw_text(canvas, 0, bottom + height * zoom + kTextAboveSection_px, caption_of(shown),
                    kBlack);
}

// Returns the greys in which the medium one of these trials is drawn.
report::GreyScale scale_of(const std::vector<DialTrial>& shown, double output_scale) {
  std::vector<float> values = shown[1].trial->section.values;
  for (float& value : values) value *= static_cast<float>(output_scale);
  return report::GreyScale(report::contrast_of(std::move(values)));
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
  const std::vector<DialTrial> shown = dial_trials(tuned);
  const bool has_sections = std::ranges::none_of(
      shown, [](const DialTrial& dial) { return dial.trial->section.values.empty(); });
  if (shown.empty() || !has_sections) {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
    return;
  }
  const selection::Section& section = shown.front().trial->section;
  const std::int64_t zoom = report::picture_zoom(section.width, section.width);
  const std::int64_t height = std::ssize(section.values) / section.width * zoom + kCaption_px;
  report::Canvas canvas(section.width * zoom, height * std::ssize(shown), kWhite);
  const report::GreyScale scale = scale_of(shown, output_scale);
  for (std::size_t i = 0; i < shown.size(); ++i)
    draw_section(shown[i], output_scale, scale, zoom,
                 height * (std::ssize(shown) - 1 - static_cast<std::int64_t>(i)), canvas);
  canvas.write(path);
}

}  // namespace tomofield::reconstruction
