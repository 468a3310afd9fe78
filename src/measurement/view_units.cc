#include "measurement/view_units.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>
#include <vector>

#include "base/log.h"
#include "base/statistics.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

// Returns the decimal logarithm of the factor by which the numbers of a view differ from the usual
// ones, if its contrast and its noise agree that they do.
double units_of(double contrast_factor, double noise_factor) {
  if (!(contrast_factor > 0 && noise_factor > 0)) return 0;
  const double contrast = std::log10(contrast_factor), noise = std::log10(noise_factor);
  if ((contrast > 0) != (noise > 0)) return 0;
  return std::fabs(contrast) < std::fabs(noise) ? contrast : noise;
}

// Returns by how much each level exceeds the median of its two neighbours on each side in tilt, as
// far as these are near: 0 without any.
std::vector<double> above_neighbours(const tilt_series::TiltSeries& series,
                                     std::span<const double> levels) {
  constexpr std::ptrdiff_t kNeighbours = 2;
  constexpr double kNearSteps = 3;  // usual ones; there may be gaps
  const auto tilt_deg = [&](std::size_t view) { return series.views()[view].tilt_deg; };
  std::vector<std::size_t> by_tilt(levels.size());
  std::iota(by_tilt.begin(), by_tilt.end(), std::size_t{0});
  std::ranges::stable_sort(by_tilt, {}, tilt_deg);
  std::vector<double> steps_deg{0.0};
  for (std::size_t i = 1; i < by_tilt.size(); ++i)
    steps_deg.push_back(tilt_deg(by_tilt[i]) - tilt_deg(by_tilt[i - 1]));
  const double near_deg = kNearSteps * base::median(steps_deg);
  std::vector<double> differences(levels.size());
  for (std::ptrdiff_t i = 0; i < std::ssize(by_tilt); ++i) {
    const std::size_t view = by_tilt[static_cast<std::size_t>(i)];
    std::vector<double> around;
    const std::ptrdiff_t end = std::min(i + kNeighbours + 1, std::ssize(by_tilt));
    for (std::ptrdiff_t j = std::max<std::ptrdiff_t>(i - kNeighbours, 0); j < end; ++j) {
      const std::size_t other = by_tilt[static_cast<std::size_t>(j)];
      if (j != i && std::fabs(tilt_deg(other) - tilt_deg(view)) <= near_deg)
        around.push_back(levels[other]);
    }
    if (!around.empty()) differences[view] = levels[view] - base::median(around);
  }
  return differences;
}

std::vector<double> sizes_of(std::span<const double> values) {
  std::vector<double> sizes;
  for (const double value : values) sizes.push_back(std::fabs(value));
  return sizes;
}

}  // namespace

void warn_of_levels(const tilt_series::TiltSeries& series, std::span<const double> levels) {
  constexpr double kNoise = 3, kPart = 0.25, kUsual = 10;
  if (levels.empty()) return;
  const std::vector<double> differences = above_neighbours(series, levels);
  const double noise = base::median(series.noise_sigma());
  const double limit = std::max({kNoise * noise, kPart * base::median(sizes_of(levels)),
                                 kUsual * base::median(sizes_of(differences))});
  for (std::size_t view = 0; view < levels.size(); ++view) {
    const double difference = std::fabs(differences[view]);
    if (!(difference > limit)) continue;
    const auto section = series.views()[view].section + 1;
    base::log_warning(fmt::format(
        "the mean grey level of section {} (tilt {:g}°) is {:.3g} away from that of its "
        "neighbours, {:.2g} times the noise: repair it, or leave it out with --exclude {}",
        section, series.views()[view].tilt_deg, difference, difference / noise, section));
  }
}

void require_common_units(const tilt_series::TiltSeries& series,
                          std::span<const double> contrasts) {
  constexpr double kUsual = 1.5, kPossible = 3;  // powers of ten
  const std::vector<double>& noise = series.noise_sigma();
  const double usual_contrast = base::median(std::vector(contrasts.begin(), contrasts.end()));
  const double usual_noise = base::median(noise);
  if (!(usual_noise > 0)) return;
  // Beside a view of immense numbers the others have no contrast: the empty beam is that view's.
  const bool has_contrast = usual_contrast > 0;
  for (std::size_t view = 0; view < contrasts.size(); ++view) {
    const double noise_factor = noise[view] / usual_noise;
    const double power =
        units_of(has_contrast ? contrasts[view] / usual_contrast : noise_factor, noise_factor);
    if (std::fabs(power) <= kUsual) continue;
    const auto section = series.views()[view].section + 1;
    const std::string what = fmt::format(
        "the contrast and the noise of section {} (tilt {:g}°) are about {:.2g} times those of the "
        "other views",
        section, series.views()[view].tilt_deg, std::pow(10, power));
    if (std::fabs(power) > kPossible)
      throw Error(fmt::format(
          "{}: its numbers are in other units, or it shows nothing; repair it or give --exclude {}",
          what, section));
    base::log_warning(
        fmt::format("{}: leave it out with --exclude {} if it is bad", what, section));
  }
}

}  // namespace tomofield::measurement
