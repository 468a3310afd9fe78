#include "output/alignment_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/check.h"
#include "base/log.h"
#include "geometry/raw_from_aligned.h"
#include "io/saving/output_set.h"
#include "io/tables/write_alignment.h"
#include "measurement/prepare.h"

namespace tomofield::output {

namespace fs = std::filesystem;
namespace {

using geometry::RawFromAligned;
using tilt_series::PlannedSeries;
using tilt_series::View;

// Returns the map of a view in pixels before binning.
RawFromAligned unbinned_map(const PlannedSeries& series, std::size_t view) {
  return series.raw_from_aligned(view).binned(1.0 / series.bin_factor());
}

RawFromAligned rotation(double angle_rad) {
  const double cosine = std::cos(angle_rad), sine = std::sin(angle_rad);
  return {cosine, -sine, sine, cosine, 0.0, 0.0};
}

// Returns the mean of the views' rotations, as directions.
double mean_rotation_rad(const PlannedSeries& series) {
  double sum_cos = 0.0, sum_sin = 0.0;
  for (std::size_t view = 0; view < series.views().size(); ++view) {
    const double angle_rad = series.raw_from_aligned(view).rotation_rad();
    sum_cos += std::cos(angle_rad);
    sum_sin += std::sin(angle_rad);
  }
  return std::atan2(sum_sin, sum_cos);
}

// Returns an angle of a section: that of its view, or else what a straight line through the two
// nearest views (the first or the last two, beyond them) gives.
double angle_at(const std::vector<View>& views, std::int64_t section, double View::*angle_deg) {
  if (views.size() == 1) return views.front().*angle_deg;
  const auto following = std::ranges::lower_bound(views, section, {}, &View::section);
  if (following != views.end() && following->section == section) return *following.*angle_deg;
  const auto next = std::clamp(following, views.begin() + 1, views.end() - 1);
  const View &a = *(next - 1), &b = *next;
  const double part =
      static_cast<double>(section - a.section) / static_cast<double>(b.section - a.section);
  constexpr double kSteepest_deg = 90.0;
  return std::clamp(a.*angle_deg + part * (b.*angle_deg - a.*angle_deg), -kSteepest_deg,
                    kSteepest_deg);
}

// Returns how far the nearest rotation moves the corners of an image at most, in its pixels.
double largest_change(const RawFromAligned& map, double width, double height) {
  const RawFromAligned nearest = rotation(map.rotation_rad());
  double largest = 0.0;
  for (const double y : {-height / 2, height / 2}) {
    const double dx = (map.m11 - nearest.m11) * width / 2 + (map.m12 - nearest.m12) * y;
    const double dy = (map.m21 - nearest.m21) * width / 2 + (map.m22 - nearest.m22) * y;
    largest = std::max(largest, std::hypot(dx, dy));
  }
  return largest;
}

// Warns if rotations and shifts do not describe the views.
void warn_of_change(const PlannedSeries& series, const AlignmentFiles& files) {
  constexpr double kNoticeable_px = 0.1;
  const double width = static_cast<double>(series.aligned_width()) * series.bin_factor();
  const double height = static_cast<double>(series.aligned_height()) * series.bin_factor();
  double largest = 0.0;
  for (std::size_t view = 0; view < series.views().size(); ++view)
    largest = std::max(largest, largest_change(unbinned_map(series, view), width, height));
  if (largest <= kNoticeable_px) return;
  base::log_warning(
      fmt::format("'{}' has rotations and shifts alone, so the corners of its views are up to "
                  "{:.2f} pixels from where '{}' has them: prefer that file",
                  files.aln.string(), largest, files.xf.string()));
}

bool has_mirrored_views(const PlannedSeries& series) {
  for (std::size_t view = 0; view < series.views().size(); ++view) {
    const RawFromAligned map = series.raw_from_aligned(view);
    if (map.m11 * map.m22 - map.m12 * map.m21 < 0) return true;
  }
  return false;
}

void remove_old(const fs::path& path) {
  if (io::OutputSet* const results = io::OutputSet::active()) results->remove_old(path);
}

// Writes the files of IMOD. `maps` has the map of every section.
void write_imod_files(const std::vector<View>& views, const std::vector<RawFromAligned>& maps,
                      const AlignmentFiles& files) {
  std::vector<io::ImodTransform> transforms;
  std::vector<double> tilts_deg, x_tilts_deg;
  for (std::size_t section = 0; section < maps.size(); ++section) {
    const auto number = static_cast<std::int64_t>(section);
    transforms.push_back(geometry::invert(maps[section]));
    tilts_deg.push_back(angle_at(views, number, &View::tilt_deg));
    x_tilts_deg.push_back(angle_at(views, number, &View::x_tilt_deg));
  }
  io::write_imod_transforms(files.xf, transforms);
  io::write_number_column(files.tlt, tilts_deg);
  if (std::ranges::any_of(x_tilts_deg, [](double angle_deg) { return angle_deg != 0.0; }))
    io::write_number_column(files.xtilt, x_tilts_deg);
  else
    remove_old(files.xtilt);
}

// Returns AreTomo's alignment. `maps` has the map of every section.
io::AreTomoAlignment aretomo_alignment(const std::vector<View>& views,
                                       const std::vector<RawFromAligned>& maps,
                                       const std::array<std::int64_t, 3>& raw_size) {
  io::AreTomoAlignment alignment;
  alignment.raw_size = raw_size;
  auto view = views.begin();
  for (std::size_t section = 0; section < maps.size(); ++section) {
    const auto number = static_cast<std::int64_t>(section);
    const double tilt_deg = angle_at(views, number, &View::tilt_deg);
    if (view == views.end() || view->section != number) {
      alignment.dark_sections.push_back(number + 1);
      alignment.dark_tilt_deg.push_back(tilt_deg);
      continue;
    }
    io::AreTomoRow row;
    row.section = number + 1;
    row.rotation_deg = maps[section].rotation_rad() * 180.0 / std::numbers::pi;
    row.shift_x_px = maps[section].shift_x_px;
    row.shift_y_px = maps[section].shift_y_px;
    row.tilt_deg = tilt_deg;
    alignment.rows.push_back(row);
    ++view;
  }
  return alignment;
}

}  // namespace

AlignmentFiles alignment_files(const fs::path& prefix) {
  const auto with = [&](const char* extension) { return fs::path(prefix.string() + extension); };
  return {with(".xf"), with(".tlt"), with(".xtilt"), with(".aln")};
}

TiltAxis tilt_axis(const PlannedSeries& series, const SpecimenOptions& specimen) {
  const geometry::TiltGeometry axis = measurement::plan_measurement(series, specimen).geometry;
  const double bin = series.bin_factor();
  return {.from_middle_px = bin * (axis.axis_x - static_cast<double>(axis.width) / 2),
          .height_px = bin * axis.axis_z,
          .thickness_px = bin * axis.thickness};
}

RawFromAligned map_from_axis(const PlannedSeries& series, std::size_t view,
                             double axis_from_middle_px) {
  return unbinned_map(series, view).counted_from(axis_from_middle_px);
}

void write_alignment_files(const PlannedSeries& series, const std::array<std::int64_t, 3>& raw_size,
                           const AlignmentFiles& files, double axis_from_middle_px) {
  const std::vector<View>& views = series.views();
  TOMOFIELD_CHECK(views.back().section < raw_size[2], "a view is of no section of the stack");
  std::vector<RawFromAligned> maps(static_cast<std::size_t>(raw_size[2]),
                                   rotation(mean_rotation_rad(series)));
  for (std::size_t view = 0; view < views.size(); ++view)
    maps[static_cast<std::size_t>(views[view].section)] =
        map_from_axis(series, view, axis_from_middle_px);
  write_imod_files(views, maps, files);
  if (has_mirrored_views(series)) {
    base::log_warning(fmt::format("'{}' is not written: AreTomo's format has no mirrored views",
                                  files.aln.string()));
    remove_old(files.aln);
    return;
  }
  io::write_aretomo_alignment(files.aln, aretomo_alignment(views, maps, raw_size));
  warn_of_change(series, files);
}

}  // namespace tomofield::output
