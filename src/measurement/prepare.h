#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "distributed/communicator.h"
#include "geometry/ray_geometry.h"
#include "geometry/tilt_geometry.h"
#include "measurement/slab_views.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/options.h"

namespace tomofield::measurement {

/// What the user says of the specimen. Lengths and positions are in unbinned
/// pixels of the aligned view, whatever --bin makes of them.
struct SpecimenOptions {
  double thickness = 0;          ///< of the volume along Z
  std::optional<Rectangle> roi;  ///< default: the whole field of view
  int hand = 1;                  ///< 1 or −1 (TiltGeometry)
  std::optional<double> axis_x;  ///< tilt axis on the view; default: its centre
  std::optional<double> axis_z;  ///< and in the volume; default: its centre
  bool with_margin = true;       ///< false: the specimen ends inside the field of view
  /// Every fault of these options for a view of this size, a sentence each.
  std::vector<std::string> faults() const;
};

/// A tilt series made ready for fitting: geometry in binned pixels, rays in
/// slab order and in density units, the noise of each view. `geometry` is of the
/// aligned views; of a series that is not resampled, `rays` are the views as
/// recorded, and `ray_geometry` says how they look at the specimen.
struct PreparedSeries {
  geometry::TiltGeometry geometry;
  std::optional<geometry::RayGeometry> ray_geometry;
  Rectangle roi;              ///< in binned pixels
  double pixel_size_A = 1.0;  ///< binned
  double bin_factor = 1.0;
  double x_tilt_deg = 0.0;          ///< the same for every view: a rotation of the volume about X
  double unit = 1.0;                ///< data units a density unit
  std::vector<double> noise_sigma;  ///< of each view, in density units
  double mean_density = 0.0;        ///< in density units
  double empty_beam = 0.0;          ///< I0 in data units (dark contrast)
  tilt_series::MaskFigures masks;   ///< what was masked, in all of the views
  std::unique_ptr<SlabViews> rays;
  std::vector<double> masked_part;  ///< of each view's `rays`: those that carry no loss
  /// Views, and which of their rows are fitted: those of the region of interest, or all.
  SlabViews::Shape rays_shape() const;
};

/// Geometry alone: no pixel is read. Throws Error for options that do not fit the series.
PreparedSeries plan_series(const tilt_series::TiltSeries& series, const SpecimenOptions& specimen);

/// Bytes that reading a view takes, besides the rays that are kept: its raw pixels, aligned and as
/// they are, with their masks, and what becomes of them.
std::size_t reading_memory(const PreparedSeries& plan);

/// Everything. `scratch_dir` takes the rays of series that do not fit in memory.
PreparedSeries prepare_series(const tilt_series::TiltSeries& series,
                              const SpecimenOptions& specimen,
                              const std::filesystem::path& scratch_dir);

/// The same on each of the processes that share it, but for `rays`: each holds those of the bands
/// (own_bands) of `band_rows` rows that are its own.
PreparedSeries prepare_series(const tilt_series::TiltSeries& series,
                              const SpecimenOptions& specimen,
                              const std::filesystem::path& scratch_dir, std::int64_t band_rows,
                              const distributed::Communicator& processes);

}  // namespace tomofield::measurement
