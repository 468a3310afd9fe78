#include "measurement/background.h"

#include "measurement/own_rays.h"

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

}  // namespace tomofield::measurement
