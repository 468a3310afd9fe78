#include "verdict/axis_check.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>

#include "base/statistics.h"
#include "base/threads/parallel.h"

namespace tomofield::verdict {
namespace {

constexpr int kDirections = 90, kStep_deg = 2, kFewestPairs = 5;
constexpr double kLeastGap_deg = 10, kMostGap_deg = 40, kNearVertical_deg = 5;
constexpr std::int64_t kLowest = 3;  // cycles over a profile

using Spectrum = std::vector<std::complex<double>>;

double direction_of(int index) { return kStep_deg * static_cast<double>(index - kDirections / 2); }

// An image without its mean, under a window that falls to 0 at the ellipse within its sides.
std::vector<double> windowed(const evaluate::Image& view) {
  std::vector<double> window(view.values.size()), values(view.values.size());
  double sum = 0, weight = 0;
  const double half_x = static_cast<double>(view.width) / 2;
  const double half_y = static_cast<double>(view.height) / 2;
  for (std::int64_t y = 0; y < view.height; ++y) {
    for (std::int64_t x = 0; x < view.width; ++x) {
      const auto i = static_cast<std::size_t>(y * view.width + x);
      const double r = std::hypot((static_cast<double>(x) + 0.5 - half_x) / half_x,
                                  (static_cast<double>(y) + 0.5 - half_y) / half_y);
      if (r >= 1 || !std::isfinite(view.values[i])) continue;
      window[i] = 0.5 + 0.5 * std::cos(std::numbers::pi * r);
      sum += window[i] * static_cast<double>(view.values[i]);
      weight += window[i];
    }
  }
  for (std::size_t i = 0; i < values.size(); ++i)
    if (window[i] > 0) values[i] = window[i] * (static_cast<double>(view.values[i]) - sum / weight);
  return values;
}

// Returns the sums of an image across a direction, at every pixel along it.
std::vector<double> profile(const evaluate::Image& view, const std::vector<double>& values,
                            double direction_deg) {
  const double angle = direction_deg * std::numbers::pi / 180;
  const double across = -std::sin(angle), along = std::cos(angle);
  const std::int64_t length = std::min(view.width, view.height);
  std::vector<double> sums(static_cast<std::size_t>(length + 1));
  for (std::int64_t y = 0; y < view.height; ++y) {
    for (std::int64_t x = 0; x < view.width; ++x) {
      const double at =
          across * (static_cast<double>(x) + 0.5 - static_cast<double>(view.width) / 2) +
          along * (static_cast<double>(y) + 0.5 - static_cast<double>(view.height) / 2) +
          static_cast<double>(length) / 2;
      const double low = std::floor(at);
      if (low < 0 || low >= static_cast<double>(length)) continue;
      const double value = values[static_cast<std::size_t>(y * view.width + x)];
      sums[static_cast<std::size_t>(low)] += value * (1 - (at - low));
      sums[static_cast<std::size_t>(low) + 1] += value * (at - low);
    }
  }
  return sums;
}

// Returns the frequencies of a profile that count.
Spectrum spectrum_of(const std::vector<double>& values) {
  const auto length = std::ssize(values) - 1;
  Spectrum spectrum;
  for (std::int64_t k = kLowest; k <= length / 4; ++k) {
    std::complex<double> sum = 0;
    const std::complex<double> turn = std::polar(
        1.0, -2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(length));
    std::complex<double> phase = 1;
    for (const double value : values) {
      sum += value * phase;
      phase *= turn;
    }
    spectrum.push_back(sum);
  }
  return spectrum;
}

double correlation(const Spectrum& one, const Spectrum& other) {
  double both = 0, of_one = 0, of_other = 0;
  for (std::size_t k = 0; k < one.size(); ++k) {
    both += (one[k] * std::conj(other[k])).real();
    of_one += std::norm(one[k]);
    of_other += std::norm(other[k]);
  }
  return of_one > 0 && of_other > 0 ? both / std::sqrt(of_one * of_other) : 0.0;
}

// Returns the mean correlation of the profiles of all pairs, [direction]. Empty with few pairs.
std::vector<float> agreements(const std::vector<std::vector<Spectrum>>& profiles,
                              const std::vector<double>& tilt_deg) {
  std::vector<float> sums(kDirections);
  int pairs = 0;
  for (std::size_t a = 0; a < tilt_deg.size(); ++a) {
    for (std::size_t b = a + 1; b < tilt_deg.size(); ++b) {
      const double gap = std::abs(tilt_deg[a] - tilt_deg[b]);
      if (gap < kLeastGap_deg || gap > kMostGap_deg) continue;
      ++pairs;
      for (std::size_t d = 0; d < sums.size(); ++d)
        sums[d] += static_cast<float>(correlation(profiles[a][d], profiles[b][d]));
    }
  }
  if (pairs < kFewestPairs) return {};
  for (float& sum : sums) sum /= static_cast<float>(pairs);
  return sums;
}

}  // namespace

std::optional<AxisCheck> check_axis(const std::vector<evaluate::Image>& views,
                                    const std::vector<double>& tilt_deg) {
  std::vector<std::vector<Spectrum>> profiles(views.size());
  base::parallel_for("check axis", std::ssize(views), [&](std::int64_t i) {
    const evaluate::Image& view = views[static_cast<std::size_t>(i)];
    const std::vector<double> values = windowed(view);
    for (int d = 0; d < kDirections; ++d)
      profiles[static_cast<std::size_t>(i)].push_back(
          spectrum_of(profile(view, values, direction_of(d))));
  });
  const std::vector<float> agreement = agreements(profiles, tilt_deg);
  if (agreement.empty()) return std::nullopt;
  const auto best = std::ranges::max_element(agreement);
  AxisCheck check{.direction_deg = direction_of(static_cast<int>(best - agreement.begin())),
                  .best = static_cast<double>(*best),
                  .vertical = -1.0,
                  .usual = base::median(agreement)};
  for (int d = 0; d < kDirections; ++d)
    if (std::abs(direction_of(d)) <= kNearVertical_deg)
      check.vertical =
          std::max(check.vertical, static_cast<double>(agreement[static_cast<std::size_t>(d)]));
  return check;
}

}  // namespace tomofield::verdict
