#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "fit/fit.h"
#include "geometry/tilt_geometry.h"
#include "measurement/measurement.h"
#include "tomofield/options.h"

namespace tomofield::testing {

/// A bead of two touching spheres of different sizes: no axis mirrors it.
struct Bead {
  std::array<double, 3> large{}, small{};  ///< X, Y, Z in pixels of the view and the slab
  static constexpr double kLarge = 4.0, kSmall = 2.5;  ///< radii in pixels

  explicit Bead(const std::array<double, 3>& center);
  double center_of_mass(std::size_t axis) const;
};

/// The analytic projections of a bead in a geometry, with noise of 0.1.
class BeadSeries {
 public:
  BeadSeries(const geometry::TiltGeometry& geometry, const Bead& bead, std::uint64_t noise_seed);
  // Its measurement reads the views from it.
  BeadSeries(const BeadSeries&) = delete;
  BeadSeries& operator=(const BeadSeries&) = delete;
  const measurement::Measurement& measurement() const { return measurement_; }

 private:
  void read(std::size_t view, std::span<float> image) const;

  geometry::TiltGeometry geometry_;
  Bead bead_;
  std::uint64_t noise_seed_;
  measurement::Measurement measurement_;
};

/// Returns the tilts from one angle to another, both with, in degrees.
std::vector<double> tilts(double from, double to, double step);

/// Returns the options of a small field of a kind.
FieldOptions small_field(FieldKind kind);

}  // namespace tomofield::testing
