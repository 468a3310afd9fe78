#include "tilt_series/masks/bead_profile.h"

#include <algorithm>
#include <cmath>

namespace tomofield::tilt_series {
namespace {

constexpr double kReach = 3.0;           // of the profile, in diameters
constexpr double kSurroundings = 2.0;    // from here on
constexpr double kRingsADiameter = 8.0;  // but no ring is thinner than half a pixel
constexpr double kThinnestRing_px = 0.5;

}  // namespace

BeadProfile::BeadProfile(double about_px)
    : about_px_(about_px), ring_px_(std::max(about_px / kRingsADiameter, kThinnestRing_px)) {
  const auto num_rings = static_cast<std::size_t>(std::ceil(kReach * about_px / ring_px_)) + 1;
  sum_.assign(num_rings, 0.0);
  count_.assign(num_rings, 0.0);
}

void BeadProfile::add(const MaskedImage& image, const std::vector<Spot>& spots) {
  const double reach = kReach * about_px_;
  for (const Spot& spot : spots) {
    const auto x0 = std::max<std::int64_t>(std::lround(spot.x_px - reach), 0),
               x1 = std::min<std::int64_t>(std::lround(spot.x_px + reach), image.width),
               y0 = std::max<std::int64_t>(std::lround(spot.y_px - reach), 0),
               y1 = std::min<std::int64_t>(std::lround(spot.y_px + reach), image.height);
    for (std::int64_t y = y0; y < y1; ++y) {
      for (std::int64_t x = x0; x < x1; ++x) {
        const double radius = std::hypot(static_cast<double>(x) + 0.5 - spot.x_px,
                                         static_cast<double>(y) + 0.5 - spot.y_px);
        const auto ring = static_cast<std::size_t>(radius / ring_px_);
        const std::size_t at = image.index(x, y);
        if (radius >= reach || !image.valid[at]) continue;
        sum_[ring] += static_cast<double>(image.values[at]);
        count_[ring] += 1;
      }
    }
  }
}

double BeadProfile::surroundings() const {
  double sum = 0.0, count = 0.0;
  for (auto ring = static_cast<std::size_t>(kSurroundings * about_px_ / ring_px_);
       ring < sum_.size(); ++ring) {
    sum += sum_[ring];
    count += count_[ring];
  }
  return count > 0 ? sum / count : 0.0;
}

double BeadProfile::height_at(double radius_px) const {
  // Rings may be empty near the centre: the innermost one with pixels is the centre.
  const auto centre = static_cast<std::size_t>(
      std::find_if(count_.begin(), count_.end(), [](double n) { return n > 0; }) - count_.begin());
  if (centre == count_.size()) return 0.0;
  const double outside = surroundings(), height = mean(centre) - outside;
  if (!(height > 0.0)) return 0.0;
  const auto ring = std::min(static_cast<std::size_t>(radius_px / ring_px_), sum_.size() - 1);
  return (mean(std::max(ring, centre)) - outside) / height;
}

std::optional<double> BeadProfile::diameter_px() const {
  double inner = 1.0;
  for (std::size_t ring = 1; ring < sum_.size(); ++ring) {
    const double radius = (static_cast<double>(ring) + 0.5) * ring_px_;
    const double height = height_at(radius);
    if (height >= 0.5) {
      inner = height;
      continue;
    }
    if (height_at(0.0) <= 0.0) return std::nullopt;
    const double part = inner > height ? (inner - 0.5) / (inner - height) : 0.5;
    return 2.0 * (radius - (1.0 - part) * ring_px_);
  }
  return std::nullopt;
}

}  // namespace tomofield::tilt_series
