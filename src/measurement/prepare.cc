#include "measurement/prepare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include "base/check.h"
#include "base/log.h"
#include "base/range.h"
#include "measurement/bands.h"
#include "measurement/measurement.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

// Largest shift in y, in pixels at the slab's faces, that a varying x-axis tilt
// may cause before single-axis slabs are no longer the geometry.
constexpr double kMaxRowShift = 0.5;

// Far beyond any specimen, and small enough to be counted in ints.
constexpr double kLargestThickness = 1e6;

// The views nearest to zero tilt that contrast is measured in: tilted ones of a
// specimen that ends in the field of view mostly show its faces.
constexpr std::size_t kContrastViews = 5;

double common_x_tilt(const std::vector<tilt_series::View>& views, double thickness) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const tilt_series::View& view : views) {
    low = std::min(low, view.x_tilt_deg);
    high = std::max(high, view.x_tilt_deg);
  }
  const double radians_each_way = (high - low) / 2 * 0.017453292519943295;
  if (thickness / 2 * std::sin(radians_each_way) > kMaxRowShift) {
    throw Error(fmt::format(
        "the x-axis tilt varies from {}° to {}° over the series, which moves rows by more than "
        "half a pixel at this thickness; single-axis slabs cannot model it: use --engine ray (of "
        "reconstruct), align with one x-axis tilt for all views, or leave --xtilt out",
        low, high));
  }
  return (low + high) / 2;
}

Rectangle scaled_roi(const Rectangle& roi, double factor) {
  const auto scale = [factor](std::int64_t v) {
    return std::llround(static_cast<double>(v) / factor);
  };
  return {scale(roi.x0), scale(roi.y0), scale(roi.x1), scale(roi.y1)};
}

void check_roi(const Rectangle& roi, const geometry::TiltGeometry& g, double factor) {
  if (roi.x0 < 0 || roi.y0 < 0 || roi.x1 > g.width || roi.y1 > g.height || roi.width() < 1 ||
      roi.height() < 1) {
    throw Error(fmt::format(
        "--roi lies outside the aligned view or is empty: the view is {:.0f} × {:.0f} pixels "
        "(unbinned), so x0,y0,x1,y1 must satisfy 0 <= x0 < x1 <= {:.0f} and 0 <= y0 < y1 <= {:.0f}",
        static_cast<double>(g.width) * factor, static_cast<double>(g.height) * factor,
        static_cast<double>(g.width) * factor, static_cast<double>(g.height) * factor));
  }
}

// An axis further away is a slip, and needs a domain of any size.
void check_axis(const geometry::TiltGeometry& g, double factor) {
  const double reach = 4 * std::max(static_cast<double>(g.width), g.thickness);
  for (const double offset :
       {g.axis_x - static_cast<double>(g.width) / 2, g.axis_z - g.thickness / 2}) {
    if (std::abs(offset) <= reach) continue;
    throw Error(fmt::format(
        "--center puts the tilt axis {:g} pixels from the middle of a view {:g} pixels wide: give "
        "x[,z] in unbinned pixels of the aligned view and the volume",
        offset * factor, static_cast<double>(g.width) * factor));
  }
}

// How the views as recorded look at the specimen.
geometry::RayGeometry ray_geometry(const tilt_series::TiltSeries& series,
                                   const geometry::TiltGeometry& aligned) {
  geometry::RayGeometry g;
  g.aligned = aligned;
  g.raw_width = series.width();
  g.raw_height = series.height();
  for (std::size_t v = 0; v < series.views().size(); ++v) {
    g.x_tilt_deg.push_back(series.views()[v].x_tilt_deg);
    g.raw_from_aligned.push_back(series.raw_from_aligned(v));
  }
  return g;
}

// Mean and noise-free standard deviation of the valid pixels of a view's rows in the region of
// interest.
struct ViewBrightness {
  double mean = 0;
  double contrast = 0;
};

ViewBrightness view_brightness(std::span<const float> image, std::span<const std::uint8_t> valid,
                               double noise) {
  double n = 0, s = 0, ss = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    if (!valid[i]) continue;
    const double b = static_cast<double>(image[i]);
    n += 1;
    s += b;
    ss += b * b;
  }
  if (n == 0) return {};
  const double mean = s / n;
  const double variance = ss / n - mean * mean;
  return {mean, std::sqrt(std::max(variance - noise * noise, 1e-4 * variance))};
}

// Reads views one after another, on all processes alike: each opens every so-manieth and hands it
// to the others.
class SharedViews {
 public:
  SharedViews(const tilt_series::TiltSeries& series, const distributed::Communicator& processes)
      : series_(series), processes_(processes) {}

  void read(std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
    if (processes_.size() == 1) return series_.read_view(view, image, valid);
    const int owner = static_cast<int>(view) % processes_.size();
    if (owner == 0) read_own(view + static_cast<std::size_t>(processes_.rank()), image.size());
    if (owner == processes_.rank()) {
      std::ranges::copy(own_image_, image.begin());
      std::ranges::copy(own_valid_, valid.begin());
    }
    processes_.broadcast(std::as_writable_bytes(image), owner);
    processes_.broadcast(std::as_writable_bytes(valid), owner);
  }

 private:
  void read_own(std::size_t view, std::size_t size) {
    own_image_.resize(size);
    own_valid_.resize(size);
    processes_.run_collectively([&] {
      if (view < series_.views().size()) series_.read_view(view, own_image_, own_valid_);
    });
  }

  const tilt_series::TiltSeries& series_;
  const distributed::Communicator& processes_;
  std::vector<float> own_image_;
  std::vector<std::uint8_t> own_valid_;
};

// Of every view; each process measures some.
std::vector<ViewBrightness> brightness_of_views(const tilt_series::TiltSeries& series,
                                                const PreparedSeries& prepared,
                                                const distributed::Communicator& processes) {
  const SlabViews::Shape shape = prepared.rays_shape();
  const std::size_t first = static_cast<std::size_t>(shape.first_row * shape.width);
  const std::size_t count = static_cast<std::size_t>(shape.num_rows * shape.width);
  std::vector<float> image(static_cast<std::size_t>(shape.width * shape.height));
  std::vector<std::uint8_t> valid(image.size());
  const std::size_t num_views = series.views().size();
  std::vector<ViewBrightness> views(num_views);
  for (std::size_t view = static_cast<std::size_t>(processes.rank()); view < num_views;
       view += static_cast<std::size_t>(processes.size())) {
    series.read_view(view, image, valid);
    views[view] =
        view_brightness(std::span(image).subspan(first, count),
                        std::span(valid).subspan(first, count), series.noise_sigma()[view]);
  }
  processes.allreduce_sum(std::span(views), &ViewBrightness::mean, &ViewBrightness::contrast);
  return views;
}

// Sets the density unit and the mean density from the series' brightness.
void measure_brightness(const std::vector<ViewBrightness>& views, PreparedSeries& prepared) {
  const geometry::TiltGeometry& g = prepared.geometry;
  std::vector<std::pair<double, double>> contrast_by_tilt;
  double mean_density = 0;
  for (int v = 0; v < g.num_views(); ++v) {
    const std::size_t view = static_cast<std::size_t>(v);
    const ViewBrightness& b = views[view];
    mean_density += b.mean * g.cos_tilt(v) / g.thickness / g.num_views();
    contrast_by_tilt.emplace_back(std::abs(g.tilt_deg[view]), b.contrast);
  }
  std::sort(contrast_by_tilt.begin(), contrast_by_tilt.end());
  const std::size_t used = std::min(kContrastViews, contrast_by_tilt.size());
  double contrast = 0;
  for (std::size_t i = 0; i < used; ++i)
    contrast += contrast_by_tilt[i].second / static_cast<double>(used);
  prepared.unit = contrast / (kContrastPerThickness * g.thickness);
  prepared.mean_density = mean_density / prepared.unit;
}

std::vector<double> masked_parts(const SlabViews& rays,
                                 const distributed::Communicator& processes) {
  std::vector<std::int64_t> valid;
  for (int view = 0; view < static_cast<int>(rays.shape().num_views); ++view)
    valid.push_back(rays.num_valid(view));
  processes.allreduce_sum(std::span(valid));
  const auto num_rays = static_cast<double>(rays.shape().width * rays.shape().num_rows);
  std::vector<double> masked;
  for (const std::int64_t n : valid) masked.push_back(1.0 - static_cast<double>(n) / num_rays);
  return masked;
}

void log_masks(const PreparedSeries& prepared) {
  const tilt_series::MaskFigures& masks = prepared.masks;
  double masked = 0;
  const int num_views = prepared.geometry.num_views();
  for (int v = 0; v < num_views; ++v)
    masked += prepared.masked_part[static_cast<std::size_t>(v)] / num_views;
  const std::string beads =
      masks.num_beads == 0
          ? "no beads"
          : fmt::format("{} beads of {:.3g} nm", masks.num_beads, masks.bead_diameter_A / 10);
  base::log_info(fmt::format("masked: {:.1f} % of all rays ({}, {} hot or dead pixels, fill)",
                             100 * masked, beads, masks.num_bad_pixels));
}

}  // namespace

std::vector<std::string> SpecimenOptions::faults() const {
  std::vector<std::string> found;
  if (!(thickness >= 1 && thickness <= kLargestThickness)) {
    found.push_back(fmt::format("--thickness must be from 1 to {} pixels, not {}",
                                kLargestThickness, thickness));
  }
  if (hand != 1 && hand != -1) found.push_back(fmt::format("--hand must be 1 or -1, not {}", hand));
  return found;
}

SlabViews::Shape PreparedSeries::rays_shape() const {
  const auto num_views = static_cast<std::size_t>(geometry.num_views());
  if (ray_geometry) {
    return {num_views, ray_geometry->raw_width, ray_geometry->raw_height, 0,
            ray_geometry->raw_height};
  }
  return {num_views, geometry.width, geometry.height, roi.y0, roi.height()};
}

std::size_t reading_memory(const PreparedSeries& plan) {
  constexpr double kBytesPerPixel = 5;
  constexpr double kCopies = 3;
  const double binned = static_cast<double>(plan.geometry.width * plan.geometry.height);
  const double raw = binned * plan.bin_factor * plan.bin_factor;
  return static_cast<std::size_t>(kCopies * kBytesPerPixel * (raw + binned));
}

PreparedSeries plan_series(const tilt_series::TiltSeries& series, const SpecimenOptions& specimen) {
  base::require_no_faults(specimen.faults());
  PreparedSeries plan;
  plan.bin_factor = series.bin_factor();
  plan.pixel_size_A = series.pixel_size_A();
  plan.empty_beam = series.empty_beam();
  std::vector<double> tilts;
  for (const tilt_series::View& view : series.views()) tilts.push_back(view.tilt_deg);
  const double thickness = std::max(1.0, std::round(specimen.thickness / plan.bin_factor));
  plan.geometry = geometry::centred_geometry(series.aligned_width(), series.aligned_height(),
                                             thickness, std::move(tilts));
  plan.geometry.hand = specimen.hand;
  if (specimen.axis_x) plan.geometry.axis_x = *specimen.axis_x / plan.bin_factor;
  if (specimen.axis_z) plan.geometry.axis_z = *specimen.axis_z / plan.bin_factor;
  plan.roi = specimen.roi ? scaled_roi(*specimen.roi, plan.bin_factor)
                          : Rectangle{0, 0, plan.geometry.width, plan.geometry.height};
  check_roi(plan.roi, plan.geometry, plan.bin_factor);
  check_axis(plan.geometry, plan.bin_factor);
  if (series.is_resampled()) {
    plan.x_tilt_deg = common_x_tilt(series.views(), thickness);
  } else {
    plan.ray_geometry = ray_geometry(series, plan.geometry);
  }
  return plan;
}

PreparedSeries prepare_series(const tilt_series::TiltSeries& series,
                              const SpecimenOptions& specimen,
                              const std::filesystem::path& scratch_dir) {
  // All rows in one band.
  return prepare_series(series, specimen, scratch_dir, series.height() + series.aligned_height(),
                        distributed::Communicator::alone());
}

PreparedSeries prepare_series(const tilt_series::TiltSeries& series,
                              const SpecimenOptions& specimen,
                              const std::filesystem::path& scratch_dir, std::int64_t band_rows,
                              const distributed::Communicator& processes) {
  PreparedSeries prepared = plan_series(series, specimen);
  measure_brightness(brightness_of_views(series, prepared, processes), prepared);
  for (const double sigma : series.noise_sigma())
    prepared.noise_sigma.push_back(sigma / prepared.unit);
  const SlabViews::Shape shape = prepared.rays_shape();
  const base::Range slabs =
      slabs_of_bands(own_bands(shape.num_rows, band_rows, processes), band_rows, shape.num_rows);
  SharedViews views(series, processes);
  prepared.rays = std::make_unique<SlabViews>(
      shape, slabs, prepared.unit,
      [&](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
        views.read(view, image, valid);
      },
      scratch_dir);
  prepared.masks = series.mask_figures();
  prepared.masked_part = masked_parts(*prepared.rays, processes);
  log_masks(prepared);
  return prepared;
}

}  // namespace tomofield::measurement
