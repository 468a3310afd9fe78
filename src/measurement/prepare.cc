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
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "measurement/read_rays.h"
#include "measurement/view_units.h"
#include "tilt_series/own_views.h"
#include "tilt_series/resampling/align_image.h"
#include "tilt_series/resampling/align_means.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

// The largest shift in y, in pixels at the slab's faces, that a varying x-axis tilt
// may cause before single-axis slabs are no longer the geometry.
constexpr double kMaxRowShift = 0.5;

// This is far beyond any specimen, and small enough to be counted in ints.
constexpr double kMaxThickness = 1e6;

// Contrast is measured in this many views nearest to zero tilt: tilted views of a
// specimen that ends in the field of view mostly show its faces.
constexpr std::size_t kContrastViews = 5;

// A background below this part of the mean brightness makes no difference.
constexpr double kLeastBackground = 0.02;

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

// Refuses an axis that is far away: it is a slip, and would need a domain of any size.
void check_axis(const geometry::TiltGeometry& g, double factor) {
  const double reach = 4 * std::max(static_cast<double>(g.width), g.thickness);
  for (const double offset :
       {g.axis_x - static_cast<double>(g.width) / 2, g.axis_z - g.thickness / 2}) {
    if (std::abs(offset) <= reach) continue;
    throw Error(
        fmt::format("--center and --shift-z put the tilt axis {:g} pixels from the middle of a "
                    "view {:g} pixels wide: give "
                    "them in unbinned pixels of the aligned view and the volume",
                    offset * factor, static_cast<double>(g.width) * factor));
  }
}

// Returns how the views as recorded look at the specimen.
geometry::RayGeometry ray_geometry(const tilt_series::PlannedSeries& series,
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

// Mean and noise-free standard deviation of the measured pixels of a view, in the rows that are
// fitted, without those of undecided beads: they would count for much, and a decision about them
// must not change the density unit.
struct ViewBrightness {
  double mean = 0;
  double contrast = 0;
};

ViewBrightness view_brightness(std::span<const float> image, std::span<const std::uint8_t> valid,
                               double noise) {
  double n = 0, s = 0, ss = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    if (valid[i] != tilt_series::kMeasurement) continue;
    const double b = static_cast<double>(image[i]);
    n += 1;
    s += b;
    ss += b * b;
  }
  if (n == 0) return {};
  const double mean = s / n;
  // Immense numbers leave less than nothing.
  const double variance = std::max(ss / n - mean * mean, 0.0);
  return {mean, std::sqrt(std::max(variance - noise * noise, 1e-4 * variance))};
}

// Measures the brightness of every view; each process measures the views that it owns.
std::vector<ViewBrightness> brightness_of_views(const tilt_series::TiltSeries& series,
                                                const ReadView& read_view,
                                                const SlabViews::Shape& shape,
                                                const distributed::Communicator& processes) {
  const base::TraceSpan span("measure brightness");
  const std::size_t first = static_cast<std::size_t>(shape.first_row * shape.width);
  const std::size_t count = static_cast<std::size_t>(shape.num_rows * shape.width);
  const auto pixels = static_cast<std::size_t>(shape.width * shape.height);
  std::vector<ViewBrightness> views(shape.num_views);
  const auto measure = [&](std::size_t view) {
    std::vector<float> image(pixels);
    std::vector<std::uint8_t> valid(pixels);
    read_view(view, image, valid);
    views[view] =
        view_brightness(std::span(image).subspan(first, count),
                        std::span(valid).subspan(first, count), series.noise_sigma()[view]);
  };
  const std::vector<std::size_t> own =
      tilt_series::own_views({0, static_cast<int>(shape.num_views)}, processes);
  const std::size_t at_once = tilt_series::views_at_once(series.decoding_memory(), processes);
  processes.run_collectively(
      [&] { tilt_series::for_views("measure brightness", own, at_once, measure); });
  processes.allreduce_sum(std::span(views), &ViewBrightness::mean, &ViewBrightness::contrast);
  return views;
}

// Sets the density unit, the mean density and the background from the series' brightness.
void set_unit(const std::vector<ViewBrightness>& views, const tilt_series::TiltSeries& series,
              Measurement& prepared) {
  const geometry::TiltGeometry& g = prepared.geometry;
  std::vector<double> contrasts, levels;
  for (const ViewBrightness& view : views) {
    contrasts.push_back(view.contrast);
    levels.push_back(view.mean);
  }
  require_common_units(series, contrasts);
  warn_of_levels(series, levels);
  std::vector<std::pair<double, double>> contrast_by_tilt;
  double mean_density = 0, brightness = 0;
  for (int v = 0; v < g.num_views(); ++v) {
    const std::size_t view = static_cast<std::size_t>(v);
    const ViewBrightness& b = views[view];
    mean_density += b.mean * g.cos_tilt(v) / g.thickness / g.num_views();
    brightness += b.mean;
    contrast_by_tilt.emplace_back(std::abs(g.tilt_deg[view]), b.contrast);
  }
  std::sort(contrast_by_tilt.begin(), contrast_by_tilt.end());
  const std::size_t used = std::min(kContrastViews, contrast_by_tilt.size());
  double contrast = 0;
  for (std::size_t i = 0; i < used; ++i)
    contrast += contrast_by_tilt[i].second / static_cast<double>(used);
  prepared.unit = contrast / (kContrastPerThickness * g.thickness);
  prepared.mean_density = mean_density / prepared.unit;
  const double mean = brightness / (g.num_views() * prepared.unit);
  if (series.background() / prepared.unit > kLeastBackground * mean)
    prepared.background = series.background() / prepared.unit;
}

void set_noise(const tilt_series::TiltSeries& series, Measurement& prepared) {
  for (const double sigma : series.noise_sigma())
    prepared.noise_sigma.push_back(sigma / prepared.unit);
}

// Returns the discs of undecided beads of each view, with y from the first row that is fitted; none
// if there are no such beads.
std::vector<std::vector<tilt_series::MaskDisc>> undecided_discs(
    const tilt_series::TiltSeries& series, const SlabViews::Shape& shape) {
  if (series.mask_metrics().bead_masking != tilt_series::BeadMasking::kUndecided) return {};
  auto discs = series.undecided_beads();
  for (auto& of_view : discs)
    for (tilt_series::MaskDisc& disc : of_view) disc.y_px -= static_cast<double>(shape.first_row);
  return discs;
}

// Holds a view as recorded, and how it is to be resampled.
struct RecordedView {
  RecordedView(const tilt_series::TiltSeries& recorded, std::size_t view,
               const geometry::ViewCorrection& correction)
      : raw(recorded.width(), recorded.height()) {
    recorded.read_view(view, raw.values, raw.valid);
    const geometry::ViewCorrection binned = correction.binned(recorded.bin_factor());
    transform = geometry::corrected(recorded.raw_from_aligned(view), binned);
    local = binned.local;
  }
  tilt_series::MaskedImage raw;
  geometry::RawFromAligned transform;
  std::optional<geometry::ViewWarp> local;
};

// Returns a function that reads views as recorded and resamples them to aligned ones.
ReadView aligning(const tilt_series::TiltSeries& recorded,
                  std::span<const geometry::ViewCorrection> corrections) {
  return [&recorded, corrections](std::size_t view, std::span<float> image,
                                  std::span<std::uint8_t> valid) {
    const tilt_series::MaskedImage aligned = read_aligned(recorded, view, corrections[view]);
    std::ranges::copy(aligned.values, image.begin());
    std::ranges::copy(aligned.valid, valid.begin());
  };
}

// Returns a function that reads views as recorded and resamples them to means over bin × bin pixels
// of the aligned ones, from `first_row` on.
ReadView aligning_means(const tilt_series::TiltSeries& recorded,
                        std::span<const geometry::ViewCorrection> corrections, int bin,
                        std::int64_t first_row) {
  return [=, &recorded](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
    const RecordedView read(recorded, view, corrections[view]);
    const tilt_series::MaskedImage means =
        tilt_series::align_means(read.raw, read.transform, recorded.aligned_width(),
                                 recorded.aligned_height(), first_row, bin, read.local);
    // There may be more rows than those that are fitted.
    std::ranges::copy_n(means.values.begin(), std::ssize(image), image.begin());
    std::ranges::copy_n(means.valid.begin(), std::ssize(valid), valid.begin());
  };
}

// Returns the tilt angles of the views with their corrections.
std::vector<double> corrected_tilts(const tilt_series::TiltSeries& recorded,
                                    std::span<const geometry::ViewCorrection> corrections) {
  std::vector<double> tilts;
  for (std::size_t view = 0; view < corrections.size(); ++view)
    tilts.push_back(recorded.views()[view].tilt_deg + corrections[view].tilt_deg);
  return tilts;
}

void log_masks(const Measurement& prepared) {
  const tilt_series::MaskMetrics& masks = prepared.masks;
  double masked = 0;
  const int num_views = prepared.geometry.num_views();
  for (int v = 0; v < num_views; ++v)
    masked += prepared.masked_part[static_cast<std::size_t>(v)] / num_views;
  const bool is_undecided = masks.bead_masking == tilt_series::BeadMasking::kUndecided;
  base::log_info(fmt::format("masked: {:.1f} % of all rays ({}, {} hot or dead pixels, fill)",
                             100 * masked, is_undecided ? "no beads" : describe_beads(masks),
                             masks.num_bad_pixels));
  if (!is_undecided) return;
  base::log_info(fmt::format(
      "found {} in a bright series, where they may be the specimen: a trial decides, or they stay",
      describe_beads(masks)));
}

}  // namespace

std::vector<std::string> faults_of(const SpecimenOptions& specimen) {
  const double thickness = specimen.thickness;
  const int hand = specimen.hand;
  std::vector<std::string> found;
  if (!(thickness >= 1 && thickness <= kMaxThickness)) {
    found.push_back(
        fmt::format("--thickness must be from 1 to {} pixels, not {}", kMaxThickness, thickness));
  }
  if (hand != 1 && hand != -1) found.push_back(fmt::format("--hand must be 1 or -1, not {}", hand));
  return found;
}

std::size_t decoding_memory(const tilt_series::PlannedSeries& series, const Measurement& plan,
                            const distributed::Communicator& processes) {
  const std::size_t of_view = series.decoding_memory();
  const std::size_t num_views =
      std::min({tilt_series::views_at_once(of_view, processes), series.views().size(),
                static_cast<std::size_t>(base::thread_count())});
  return num_views * of_view + SlabViews::filling_memory(plan.rays_shape());
}

Measurement plan_measurement(const tilt_series::PlannedSeries& series,
                             const SpecimenOptions& specimen) {
  base::require_no_faults(faults_of(specimen));
  Measurement plan;
  plan.bin_factor = series.bin_factor();
  plan.pixel_size_A = series.pixel_size_A();
  std::vector<double> tilts;
  for (const tilt_series::View& view : series.views()) tilts.push_back(view.tilt_deg);
  const double thickness = std::max(1.0, std::round(specimen.thickness / plan.bin_factor));
  plan.geometry = geometry::centred_geometry(series.aligned_width(), series.aligned_height(),
                                             thickness, std::move(tilts));
  plan.geometry.hand = specimen.hand;
  if (specimen.axis_x)  // binning keeps the middle of a view, and may cut its edges
    plan.geometry.axis_x +=
        (*specimen.axis_x - static_cast<double>(series.plan().aligned_width) / 2) / plan.bin_factor;
  if (specimen.axis_z) plan.geometry.axis_z = *specimen.axis_z / plan.bin_factor;
  plan.geometry.axis_z += specimen.shift_z / plan.bin_factor;
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

Measurement prepare_measurement(const tilt_series::TiltSeries& series,
                                const SpecimenOptions& specimen,
                                const std::filesystem::path& scratch_dir,
                                std::vector<microscope::ViewTransfer> transfers) {
  // All rows in one band.
  return prepare_measurement(series, specimen, scratch_dir,
                             series.height() + series.aligned_height(),
                             distributed::Communicator::alone(), std::move(transfers));
}

Measurement prepare_measurement(const tilt_series::TiltSeries& series,
                                const SpecimenOptions& specimen,
                                const std::filesystem::path& scratch_dir, std::int64_t band_rows,
                                const distributed::Communicator& processes,
                                std::vector<microscope::ViewTransfer> transfers) {
  Measurement prepared = plan_measurement(series, specimen);
  prepared.transfers = std::move(transfers);
  const SlabViews::Shape shape = prepared.rays_shape();
  const ReadView read_view = [&](std::size_t view, std::span<float> image,
                                 std::span<std::uint8_t> valid) {
    series.read_view(view, image, valid);
  };
  set_unit(brightness_of_views(series, read_view, shape, processes), series, prepared);
  set_noise(series, prepared);
  prepared.rays = read_rays(
      series, {shape, 1, prepared.unit, band_rows, scratch_dir},
      [&](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
        series.read_view(view, image, valid, transfer_of(prepared.transfers, view));
        series.forget_view(view);
      },
      processes);
  prepared.masks = series.mask_metrics();
  prepared.undecided_beads = undecided_discs(series, shape);
  prepared.masked_part = prepared.rays->masked_parts(processes);
  log_masks(prepared);
  return prepared;
}

tilt_series::MaskedImage read_aligned(const tilt_series::TiltSeries& recorded, std::size_t view,
                                      const geometry::ViewCorrection& correction) {
  const RecordedView read(recorded, view, correction);
  return tilt_series::align_image(read.raw, read.transform, recorded.aligned_width(),
                                  recorded.aligned_height(), read.local);
}

Measurement plan_realigned(const tilt_series::TiltSeries& recorded, const SpecimenOptions& specimen,
                           const distributed::Communicator& processes) {
  const std::vector<geometry::ViewCorrection> none(recorded.views().size());
  Measurement prepared = plan_measurement(recorded, specimen);
  prepared.x_tilt_deg = common_x_tilt(recorded.views(), prepared.geometry.thickness);
  prepared.ray_geometry.reset();
  set_unit(
      brightness_of_views(recorded, aligning(recorded, none), prepared.rays_shape(), processes),
      recorded, prepared);
  set_noise(recorded, prepared);
  return prepared;
}

void realign(const tilt_series::TiltSeries& recorded,
             std::span<const geometry::ViewCorrection> corrections, int bin,
             const std::filesystem::path& scratch_dir, std::int64_t band_rows,
             const distributed::Communicator& processes, Measurement& measurement) {
  measurement.rays.reset();  // its successor needs the memory
  const SlabViews::Shape shape = measurement.rays_shape();
  measurement.rays =
      read_rays(recorded, {shape, bin, measurement.unit, band_rows, scratch_dir},
                bin == 1 ? aligning(recorded, corrections)
                         : aligning_means(recorded, corrections, bin, shape.first_row),
                processes);
  measurement.rays_bin = bin;
  measurement.geometry.tilt_deg = corrected_tilts(recorded, corrections);
}

}  // namespace tomofield::measurement
