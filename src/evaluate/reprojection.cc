#include "evaluate/reprojection.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/aligned_buffer.h"
#include "base/check.h"
#include "base/threads/parallel.h"
#include "base/utf8.h"
#include "evaluate/box.h"
#include "evaluate/volume_pair.h"
#include "io/images/mrc_format.h"
#include "io/saving/scratch_memory.h"
#include "kernels/lanes.h"
#include "measurement/held_out.h"
#include "measurement/undecided_beads.h"
#include "projection/sample_grid.h"
#include "projection/slab_projector.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

using kernels::kLanes;

// Copies a slab of the volume to samples at the centres of the voxels. Lanes past the last row stay
// zero.
void copy_slab(const base::Volume& volume, int slab, const projection::SampleSegment& segment,
               float* samples) {
  const std::int64_t first_row = std::int64_t{slab} * kLanes;
  const std::int64_t rows = std::min<std::int64_t>(kLanes, volume.shape.ny - first_row);
  for (std::int64_t z = 0; z < volume.shape.nz; ++z) {
    float* row = samples + segment.origin + z * segment.stride_z();
    for (std::int64_t lane = 0; lane < rows; ++lane)
      for (std::int64_t x = 0; x < volume.shape.nx; ++x)
        row[x * kLanes + lane] = volume.at(x, first_row + lane, z);
  }
}

// Returns true if a ray stays within the centres of the outermost voxels across x as long as it
// crosses samples. These fade over half a voxel beyond the thickness.
bool stays_inside(const VolumePlace& place, int view, double u) {
  const geometry::TiltGeometry& g = place.geometry;
  const double low = static_cast<double>(place.roi.x0) + 0.5;
  const double high = static_cast<double>(place.roi.x1) - 0.5;
  return std::ranges::all_of(std::array{-0.5, g.thickness + 0.5}, [&](double z) {
    const double x = g.ray_x(view, u, z);
    return low <= x && x <= high;
  });
}

// Returns for each x of a view whether its rays are scored; it is the same for all rows.
std::vector<char> scored_pixels(const VolumePlace& place, int view) {
  std::vector<char> scored;
  for (std::int64_t x = 0; x < place.geometry.width; ++x)
    scored.push_back(place.is_whole_specimen ||
                     stays_inside(place, view, static_cast<double>(x) + 0.5));
  return scored;
}

// Adds up the errors ray by ray in double: the offset of a volume may be large against its
// contrast.
measurement::ViewSums ray_sums(const float* measured, const std::uint16_t* mask,
                               const std::vector<char>& scored, const float* predicted) {
  measurement::ViewSums sums;
  for (std::size_t x = 0; x < scored.size(); ++x) {
    for (std::size_t lane = 0; scored[x] && lane < kLanes; ++lane) {
      if ((mask[x] >> lane & 1) == 0) continue;
      const std::size_t ray = x * kLanes + lane;
      measurement::ray_data_term({}, 1.0, static_cast<double>(measured[ray]),
                                 static_cast<double>(predicted[ray]), sums);
    }
  }
  return sums;
}

std::vector<measurement::ViewSums> slab_sums(const projection::SlabProjector& projector,
                                             const base::Volume& volume,
                                             const measurement::SlabViews& measured,
                                             std::span<const int> views,
                                             const std::vector<std::vector<char>>& scored,
                                             int slab) {
  const std::int64_t width = projector.geometry().width;
  base::AlignedBuffer<float> samples(projector.grid().size());
  base::AlignedBuffer<float> rays(projector.detector_size(views.size()));
  copy_slab(volume, slab, projector.grid().segments().front(), samples.data());
  projector.forward(samples.data(), views, rays.data());
  std::vector<measurement::ViewSums> sums;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const float* predicted = rays.data() + static_cast<std::ptrdiff_t>(v) * width * kLanes;
    sums.push_back(ray_sums(measured.rays(slab, views[v]), measured.mask(slab, views[v]), scored[v],
                            predicted));
  }
  return sums;
}

void require_rays(const measurement::SlabSums& sums, std::span<const int> views,
                  const VolumePlace& place) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (std::ranges::any_of(sums, [v](const auto& slab) { return slab[v].n > 0; })) continue;
    throw Error(fmt::format(
        "no ray of the view at {:g}° stays within the volume: give --no-margin if the specimen "
        "ends inside it, or leave the view out with --exclude",
        place.geometry.tilt_deg[static_cast<std::size_t>(views[v])]));
  }
}

void check_volume(const base::Volume& volume, const measurement::Measurement& series,
                  const std::filesystem::path& path) {
  if (series.x_tilt_deg != 0.0) {
    throw Error(fmt::format(
        "the series has an x-axis tilt of {}°, which is not turned back here: leave --xtilt and "
        "--x-axis-tilt out if the volume was made without them",
        std::abs(series.x_tilt_deg)));
  }
  if (volume.shape.nx != series.roi.width() || volume.shape.ny != series.roi.height()) {
    throw Error(fmt::format(
        "'{}' has {} × {} × {} voxels, but the region of the views has {} × {} pixels: give the "
        "--bin and --roi that it was made with, and axes in the order xyz",
        path.string(), volume.shape.nx, volume.shape.ny, volume.shape.nz, series.roi.width(),
        series.roi.height()));
  }
  for (const float value : volume.data) {
    if (!std::isfinite(value))
      throw Error(
          fmt::format("'{}' has NaN or infinite voxels, which cannot be projected", path.string()));
  }
}

// Throws Error if a volume of tomofield states another place than the region of the views, from the
// lower face of the specimen on.
void require_place(const std::filesystem::path& path, const measurement::Measurement& series) {
  const io::MrcReader volume(path);
  if (is_turned(volume))
    throw Error(fmt::format(
        "'{}' was turned before it was sampled, and is projected as it lies in the views: give "
        "the volume that `reconstruct` wrote, or `export` without an angle",
        path.string()));
  if (io::is_in_labels(volume.header(), io::kLabelOfXTilt))
    throw Error(fmt::format(
        "the x-axis tilt of the series is turned back in '{}', which a projection into the views "
        "does not know: give a volume that was made without --xtilt and --x-axis-tilt",
        path.string()));
  const auto place = place_A(volume);
  if (!place || lies_at(*place, series.roi, series.pixel_size_A)) return;
  const auto& [x_A, y_A, z_A] = *place;
  throw Error(fmt::format(
      "'{}' begins at {:.4g}, {:.4g}, {:.4g} pixels of the views (ORIGIN), and the region at {}, "
      "{}, 0: give the --roi that it was made with, and its whole thickness",
      path.string(), x_A / series.pixel_size_A, y_A / series.pixel_size_A,
      z_A / series.pixel_size_A, series.roi.x0, series.roi.y0));
}

std::vector<int> scored_views(const geometry::TiltGeometry& geometry, int hold_out) {
  if (hold_out > 0) return measurement::held_out_views(geometry.tilt_deg, hold_out);
  std::vector<int> all(static_cast<std::size_t>(geometry.num_views()));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

}  // namespace

measurement::ViewErrors reprojection_errors(const base::Volume& volume, const VolumePlace& place,
                                            const measurement::SlabViews& measured,
                                            std::vector<int> views,
                                            std::span<const double> noise_weight) {
  const projection::SlabProjector projector(
      place.geometry,
      projection::make_sample_grid(place.geometry, static_cast<double>(place.roi.x0),
                                   static_cast<double>(place.roi.x1), 0.0));
  const projection::SampleSegment& segment = projector.grid().segments().front();
  TOMOFIELD_CHECK(segment.nx == volume.shape.nx && segment.nz == volume.shape.nz &&
                      measured.shape().num_rows == volume.shape.ny,
                  "one voxel a sample");
  std::vector<std::vector<char>> scored;
  for (const int view : views) scored.push_back(scored_pixels(place, view));
  measurement::SlabSums sums(static_cast<std::size_t>(measured.num_slabs()));
  base::parallel_for("reproject", measured.num_slabs(), [&](std::int64_t slab) {
    sums[static_cast<std::size_t>(slab)] =
        slab_sums(projector, volume, measured, views, scored, static_cast<int>(slab));
  });
  require_rays(sums, views, place);
  return measurement::view_errors(std::move(views), sums, noise_weight, true);
}

VolumeScore score_volume(const VolumeScoreOptions& options) {
  const base::Volume volume = evaluate::read_volume(options.volume);
  const tilt_series::TiltSeries series(options.input);
  SpecimenOptions specimen = options.specimen;
  specimen.thickness = static_cast<double>(volume.shape.nz) * series.bin_factor();
  const measurement::Measurement plan = measurement::plan_measurement(series, specimen);
  common_voxel_size_A(fmt::format("'{}'", options.volume.string()), volume.voxel_size_A,
                      fmt::format("the series '{}'", options.input.stack.string()),
                      plan.pixel_size_A);
  check_volume(volume, plan, options.volume);
  require_place(options.volume, plan);
  measurement::Measurement prepared =
      measurement::prepare_measurement(series, specimen, io::scratch_directory({}));
  keep_beads(prepared);  // all volumes are scored on the same rays
  std::vector<double> noise_weight;
  for (const double sigma : prepared.noise_sigma) noise_weight.push_back(1.0 / (sigma * sigma));
  VolumeScore score;
  score.unit = prepared.unit;
  score.errors = evaluate::reprojection_errors(
      volume, {prepared.geometry, prepared.roi, !options.with_margin}, *prepared.rays,
      scored_views(prepared.geometry, options.hold_out), noise_weight);
  for (const int view : score.errors.views)
    score.tilt_deg.push_back(prepared.geometry.tilt_deg[static_cast<std::size_t>(view)]);
  return score;
}

}  // namespace tomofield::evaluate
