#include "measurement/background.h"

#include <memory>
#include <numeric>
#include <vector>

#include "base/check.h"

namespace tomofield::measurement {
namespace {

// Returns what a brightness of all rays adds to the mean density.
double density_of(double brightness, const Measurement& measurement) {
  const geometry::TiltGeometry& g = measurement.geometry;
  double cosines = 0;
  for (int view = 0; view < g.num_views(); ++view) cosines += g.cos_tilt(view);
  return brightness * cosines / g.num_views() / g.thickness;
}

}  // namespace

void subtract_background(double part, Measurement& measurement) {
  const double subtracted = part * measurement.background;
  if (subtracted == 0.0) return;
  own_rays(measurement).subtract(static_cast<float>(subtracted));
  measurement.mean_density -= density_of(subtracted, measurement);
  measurement.background -= subtracted;
  measurement.subtracted_background += subtracted;
}

Measurement without_background(double part, const Measurement& measurement) {
  Measurement copy = with_own_rays(measurement);
  subtract_background(part, copy);
  return copy;
}

SlabViews& own_rays(Measurement& measurement) {
  TOMOFIELD_CHECK(measurement.rays.use_count() == 1, "a copy of the measurement shares its rays");
  // Nobody else sees these rays, which were not made constant.
  return *std::const_pointer_cast<SlabViews>(measurement.rays);
}

Measurement with_own_rays(const Measurement& measurement) {
  std::vector<int> views(static_cast<std::size_t>(measurement.geometry.num_views()));
  std::iota(views.begin(), views.end(), 0);
  Measurement copy = measurement;
  copy.rays =
      measurement.rays->rows({0, static_cast<int>(measurement.rays->shape().num_rows)}, views);
  return copy;
}

}  // namespace tomofield::measurement
