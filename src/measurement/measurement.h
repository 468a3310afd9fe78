#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "distributed/communicator.h"
#include "geometry/ray_geometry.h"
#include "geometry/tilt_geometry.h"
#include "measurement/slab_views.h"
#include "tomofield/options.h"

namespace tomofield::measurement {

/// The contrast of an untilted view (standard deviation over its pixels) that one density unit
/// stands for, per pixel of thickness: the yardstick phantoms, with densities between 0 and 1, have
/// 0.07 to 0.08.
constexpr double kContrastPerThickness = 0.075;

/// What is fitted: the geometry, the measured rays (divided by the density
/// unit) and the noise of each view in the same units.
struct Measurement {
  geometry::TiltGeometry geometry;
  Rectangle roi;
  const SlabViews* rays = nullptr;
  std::vector<double> noise_sigma;
  double mean_density = 0.0;
  /// For the ray engine: how `rays`, which are then the views as recorded, look at the specimen.
  std::optional<geometry::RayGeometry> ray_geometry = std::nullopt;
  /// Views that carry no loss and only tell how well the others predict them (slab engine).
  std::vector<int> held_out = {};
  /// Who share the fit. Each holds the slabs of its own_bands() in `rays`.
  const distributed::Communicator* processes = &distributed::Communicator::alone();

  /// Of the views near zero tilt (standard deviation over their pixels), in density units times
  /// pixels: what defines the unit.
  double contrast() const { return kContrastPerThickness * geometry.thickness; }
  int num_fitted_views() const { return geometry.num_views() - static_cast<int>(held_out.size()); }
};

/// A measurement in pixels `bin` times as wide, of which a density unit stays what it
/// is: for coarse stages. `roi` stays in fine pixels, as the field does.
struct BinnedMeasurement : Measurement {
  BinnedMeasurement(const Measurement& fine, int bin);

 private:
  std::unique_ptr<SlabViews> own_rays_;
};

}  // namespace tomofield::measurement
