#include "tilt_series/section_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/log.h"
#include "io/tables/alignment_files.h"
#include "tilt_series/tilt_angles.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

using geometry::RawFromAligned;

double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

void require_raw_size(const io::AreTomoAlignment& alignment, const std::filesystem::path& path,
                      const io::ImageStack& stack) {
  const io::MrcHeader& header = stack.header();
  const auto& raw_size = alignment.raw_size;
  if (!raw_size || ((*raw_size)[0] == header.nx && (*raw_size)[1] == header.ny)) return;
  throw Error(fmt::format(
      "'{}' aligns images of {} × {} pixels but '{}' has {} × {}; give the "
      "stack that AreTomo aligned, unbinned",
      path.string(), (*raw_size)[0], (*raw_size)[1], stack.name(), header.nx, header.ny));
}

// A stack that AreTomo wrote may lack the dark frames, and versions count them or not.
void warn_of_other_count(const io::AreTomoAlignment& alignment, const std::filesystem::path& path,
                         const io::ImageStack& stack) {
  const auto num_rows = std::ssize(alignment.rows);
  const auto num_dark = std::ssize(alignment.dark_sections);
  if (!alignment.raw_size) return;
  const std::int64_t stated = (*alignment.raw_size)[2];
  if (stated == num_rows || stated == num_rows + num_dark) return;
  base::log_warning(fmt::format(
      "'{}' states a stack of {} sections (RawSize) and has {} rows and {} dark frames; '{}' has "
      "{} sections: are they of one series?",
      path.string(), stated, num_rows, num_dark, stack.name(), stack.header().nz));
}

AlignedSection section_of(const io::AreTomoRow& row) {
  const double cosine = std::cos(radians(row.rotation_deg));
  const double sine = std::sin(radians(row.rotation_deg));
  return {row.tilt_deg, 0.0, row.rotation_deg,
          RawFromAligned{cosine, -sine, sine, cosine, row.shift_x_px, row.shift_y_px}, row.line};
}

/// Returns what this program adds to the shift of another program's view, in pixels. The other
/// program counts from its centres: with d and e from this program's centres to those of the image
/// and of the specimen, its p = R P + shift becomes p = R P + (shift + d − R e), where
/// R = Rz(rotation) Ry(tilt) Rx(x tilt). The specimen has an even number of pixels, which makes e
/// (1/2, 1/2, 1/2).
std::array<double, 2> shift_between_centres(const io::ListedView& view, io::CentreRule centre,
                                            const io::MrcHeader& images) {
  const double cosine = std::cos(radians(view.rotation_deg));
  const double sine = std::sin(radians(view.rotation_deg));
  const double tilt = radians(view.tilt_deg), x_tilt = radians(view.x_tilt_deg);
  const double e = io::distance_from_middle_px(centre, 2);
  const double turned_y = e * std::cos(x_tilt) - e * std::sin(x_tilt);
  const double turned_z = e * std::sin(x_tilt) + e * std::cos(x_tilt);
  const double turned_x = e * std::cos(tilt) + turned_z * std::sin(tilt);
  return {io::distance_from_middle_px(centre, images.nx) - (cosine * turned_x - sine * turned_y),
          io::distance_from_middle_px(centre, images.ny) - (sine * turned_x + cosine * turned_y)};
}

AlignedSection section_of(const io::ListedView& view, io::CentreRule centre,
                          const io::MrcHeader& images, double pixel_size_A) {
  const double cosine = std::cos(radians(view.rotation_deg));
  const double sine = std::sin(radians(view.rotation_deg));
  const auto [x, y] = shift_between_centres(view, centre, images);
  const RawFromAligned map{cosine,
                           -sine,
                           sine,
                           cosine,
                           view.shift_x_A / pixel_size_A + x,
                           view.shift_y_A / pixel_size_A + y};
  return {view.tilt_deg, view.x_tilt_deg, view.rotation_deg, map, 0};
}

// The averages of a movie may be binned, and are then about as large in Å.
void warn_of_other_size(const io::ViewTable& table, const io::ImageStack& stack,
                        double pixel_size_A) {
  constexpr double kRounding = 0.05;
  if (!table.image_size_A || pixel_size_A <= 0.0) return;
  const std::array<double, 2> size_A{static_cast<double>(stack.header().nx) * pixel_size_A,
                                     static_cast<double>(stack.header().ny) * pixel_size_A};
  const auto is_near = [](double a, double b) { return std::fabs(a / b - 1.0) <= kRounding; };
  const auto [width_A, height_A] = *table.image_size_A;
  if (is_near(size_A[0], width_A) && is_near(size_A[1], height_A)) return;
  base::log_warning(fmt::format(
      "'{}' states images of {:.0f} × {:.0f} Å, and its images have {:.0f} × {:.0f} Å: are they of "
      "one series, and is the pixel size right (--pixel-size)?",
      table.file.string(), width_A, height_A, size_A[0], size_A[1]));
}

}  // namespace

SectionTable sections_of_aretomo(const std::filesystem::path& path, const io::ImageStack& stack,
                                 bool needs_tilt) {
  const io::AreTomoAlignment alignment = io::read_aretomo_alignment(path, needs_tilt);
  require_raw_size(alignment, path, stack);
  const auto sections =
      io::assign_aretomo_sections(alignment, path, stack.header().nz, stack.name());
  warn_of_other_count(alignment, path, stack);
  SectionTable table{.source = path.string(), .of_section = {}};
  table.of_section.resize(static_cast<std::size_t>(stack.header().nz));
  for (std::size_t row = 0; row < sections.size(); ++row)
    table.of_section[static_cast<std::size_t>(sections[row])] = section_of(alignment.rows[row]);
  if (!alignment.patches.empty()) table.patches.resize(table.of_section.size());
  for (std::size_t row = 0; row < alignment.patches.size(); ++row)
    table.patches[static_cast<std::size_t>(sections[row])] = alignment.patches[row];
  if (alignment.beta_offset_deg != 0)
    base::log_warning(
        fmt::format("'{0}': BetaOffset, {1}°, is not applied, as in AreTomo's own volumes "
                    "(--x-axis-tilt turns the specimen about X)",
                    path.string(), alignment.beta_offset_deg));
  if (std::ranges::any_of(alignment.rows,
                          [](const io::AreTomoRow& row) { return row.magnification != 1.0; })) {
    base::log_warning(
        fmt::format("'{}' has magnifications (GMAG), which are not applied, as in AreTomo's own "
                    "volumes: an .xf file holds magnifications",
                    path.string()));
  }
  return table;
}

SectionTable sections_of_views(const io::ViewTable& table, const io::ImageStack& stack,
                               double pixel_size_A) {
  require_count(table.views.size(), table.file, "views", stack);
  SectionTable sections{
      .source = table.file.string(), .of_section = {}, .is_nominal = table.is_nominal};
  if (!table.views.empty()) sections.nominal_axis_deg = table.views.front().nominal_axis_deg;
  for (const io::ListedView& view : table.views) {
    sections.of_section.emplace_back();
    sections.nominal_tilt_deg.push_back(view.nominal_tilt_deg);
    if (view.is_used)
      sections.of_section.back() = section_of(view, table.centre, stack.header(), pixel_size_A);
  }
  warn_of_other_size(table, stack, pixel_size_A);
  for (const std::string& what : table.not_applied)
    base::log_warning(fmt::format("'{}' has {}, which is not applied", table.file.string(), what));
  for (const std::string& remark : table.remarks)
    base::log_warning(fmt::format("'{}': {}", table.file.string(), remark));
  return sections;
}

void set_alignment(const AlignedSection& section, io::CentreRule centre,
                   const io::MrcHeader& images, double pixel_size_A, io::ListedView& view) {
  view.tilt_deg = section.tilt_deg;
  view.x_tilt_deg = section.x_tilt_deg;
  view.rotation_deg = section.rotation_deg;
  const auto [x, y] = shift_between_centres(view, centre, images);
  view.shift_x_A = (section.raw_from_aligned.shift_x_px - x) * pixel_size_A;
  view.shift_y_A = (section.raw_from_aligned.shift_y_px - y) * pixel_size_A;
}

}  // namespace tomofield::tilt_series
