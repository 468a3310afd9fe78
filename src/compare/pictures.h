#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "evaluate/profile.h"
#include "report/html.h"
#include "report/slice.h"
#include "tomofield/options.h"

namespace tomofield::compare {

/// A volume with the name of its pictures and the title below them.
struct Shown {
  std::string name, title;
  std::vector<report::Slice> planes;  ///< xy, xz, yz
};

/// The parts of a volume that are drawn: its central planes, and a detail of the first one.
inline constexpr std::array kPictureParts{"xy", "xz", "yz", "detail"};
/// Returns the file of such a picture.
std::filesystem::path picture_path(const std::filesystem::path& folder, const std::string& volume,
                                   const std::string& part);

/// Returns the part of an xy plane that the report enlarges, in voxels: the square with the largest
/// standard deviation on a lattice of half its side. Its side is a third of the plane's shorter
/// side, at least 32 voxels.
Rectangle busiest_detail(const report::Slice& plane);

/// Draws the same plane (0: xy, 1: xz, 2: yz) of every volume. PNG files go to `folder`.
std::vector<report::HtmlFigure> plane_figures(const std::vector<Shown>& volumes, std::size_t plane,
                                              const report::GreyScale& scale,
                                              const std::filesystem::path& folder);
/// Draws the detail of every xy plane. PNG files go to `folder`.
std::vector<report::HtmlFigure> detail_figures(const std::vector<Shown>& volumes,
                                               const Rectangle& detail,
                                               const report::GreyScale& scale,
                                               const std::filesystem::path& folder);
/// Returns the line along x through the middle of the detail in the central xy plane.
evaluate::LineSegment line_through(const Rectangle& detail, std::int64_t num_planes);

}  // namespace tomofield::compare
