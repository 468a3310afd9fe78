#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "distributed/communicator.h"
#include "geometry/ray_geometry.h"
#include "geometry/tilt_geometry.h"
#include "measurement/slab_views.h"
#include "microscope/view_transfer.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::measurement {

/// The contrast of an untilted view (standard deviation over its pixels) that one density unit
/// stands for, per pixel of thickness: the yardstick phantoms, with densities between 0 and 1, have
/// 0.07 to 0.08.
constexpr double kContrastPerThickness = 0.075;

/// A measurement to be fitted: rays, how they look at the specimen, their noise. Lengths are in
/// binned pixels, densities in density units. Copies share the rays.
///
/// `geometry` is that of the aligned views. In a series that is not resampled, the rays are the
/// views as recorded, and `ray_geometry` says how they look at the specimen.
struct Measurement {
  geometry::TiltGeometry geometry;
  Rectangle roi;
  std::shared_ptr<const SlabViews> rays = nullptr;  ///< divided by the unit; null in a plan
  /// The number of pixels on each axis over which rays are means, like those of binned(). They
  /// serve its multiples alone. All else is in the pixels of the views.
  int rays_bin = 1;
  std::vector<double> noise_sigma = {};  ///< [view]
  double mean_density = 0.0;
  std::optional<geometry::RayGeometry> ray_geometry = std::nullopt;
  /// [view]: what the microscope makes of the projections, in the pixels of the rays. Empty: the
  /// views are the projections themselves.
  std::vector<microscope::ViewTransfer> transfers = {};
  /// Views that carry no loss: they only tell how well the others predict them. Ascending.
  std::vector<int> held_out = {};
  /// Views that carry no loss and tell nothing, because another fit has them. Ascending.
  std::vector<int> left_out = {};

  // The members below say where the measurement comes from.
  double unit = 1.0;  ///< data units a density unit
  double pixel_size_A = 1.0;
  double bin_factor = 1.0;  ///< of `pixel_size_A` to the stack's
  double x_tilt_deg = 0.0;  ///< the same for every view: a rotation of the volume about X
  /// The brightness of the emptiest places of a bright series, in density units times pixels, which
  /// the rays still contain (background.h); 0 if it is small beside the specimen's.
  double background = 0.0;
  double subtracted_background = 0.0;  ///< the part of it that the rays do not contain any more
  tilt_series::MaskMetrics masks = {};
  std::vector<double> masked_part = {};  ///< [view]: the part of the rays that carries no loss
  /// [view]: discs of beads whose rays count until hide_beads() or keep_beads() is called
  /// (undecided_beads.h), in the pixels of the rays, with y from their first row. Empty if nothing
  /// is undecided.
  std::vector<std::vector<tilt_series::MaskDisc>> undecided_beads = {};

  /// Returns the contrast of the views near zero tilt, in density units times pixels: the standard
  /// deviation over their pixels that defines the unit.
  double contrast() const { return kContrastPerThickness * geometry.thickness; }
  /// Returns 1 / σ² of each view.
  std::vector<double> noise_weights() const;
  /// Returns the views that are neither held out nor left out, ascending.
  std::vector<int> fitted_views() const;
  int num_fitted_views() const { return static_cast<int>(fitted_views().size()); }
  /// Returns the views' size and which of their rows are fitted: those of the region of interest,
  /// or all rows of views as recorded.
  SlabViews::Shape rays_shape() const;
};

/// Returns the measurement in pixels `bin` times as wide, for coarse stages. A density unit stays
/// what it is. `roi` stays in fine pixels, as the field does. Discs of undecided beads are scaled;
/// to mask a pixel by its fine pixels, decide before.
Measurement binned(const Measurement& fine, int bin);

/// Returns the measurement of these views alone (ascending), on some rows of the region of
/// interest, counted from its first one, on every process. Views are counted again from 0; of the
/// views held out, those that are left stay held out. Undecided beads stay undecided. It must be of
/// resampled views, whose rays stay in their row.
Measurement some_rows(
    const Measurement& whole, base::Range rows, std::span<const int> views,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Returns the same of at most `max_rows` rows in the middle.
Measurement middle_rows(
    const Measurement& whole, std::int64_t max_rows, std::span<const int> views,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::measurement
