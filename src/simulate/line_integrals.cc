#include "simulate/line_integrals.h"

namespace tomofield::simulate {
namespace {

// Returns the length of a ray inside the box |x| <= half_width, |z| <= half_thickness.
double box_chord(const Beam& beam, double u, double half_width, double half_thickness) {
  double enter = -1e300, leave = 1e300;
  const auto clip = [&](double origin, double direction, double half) {
    if (std::abs(direction) < 1e-12) {
      if (std::abs(origin) > half) leave = enter;
      return;
    }
    const double t0 = (-half - origin) / direction, t1 = (half - origin) / direction;
    enter = std::max(enter, std::min(t0, t1));
    leave = std::min(leave, std::max(t0, t1));
  };
  clip(u * beam.cosine, -beam.sine, half_width);
  clip(u * beam.sine, beam.cosine, half_thickness);
  return std::max(leave - enter, 0.0);
}

}  // namespace

double slab_integral(const Phantom& phantom, const Beam& beam, double u, double y) {
  const double thickness = static_cast<double>(phantom.shape.nz);
  if (phantom.is_extended) return phantom.slab_density * (thickness / beam.cosine);
  if (std::abs(y) > static_cast<double>(phantom.shape.ny) / 2.0) return 0.0;
  const double half_width = static_cast<double>(phantom.shape.nx) / 2.0;
  return phantom.slab_density * box_chord(beam, u, half_width, thickness / 2.0);
}

}  // namespace tomofield::simulate
