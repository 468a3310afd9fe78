#include "measurement/view_units.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
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

}  // namespace

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
