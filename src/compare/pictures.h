#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "report/curve_plot.h"
#include "report/grey_scale.h"
#include "report/html.h"
#include "report/slice.h"

namespace tomofield::compare {

/// A volume with the name that its pictures get and the title below them.
struct Shown {
  std::string name, title;
  std::vector<report::Slice> planes;  ///< xy, xz, yz
};

/// Part of the xy plane that is looked at closely, in voxels, the last excluded.
struct Detail {
  std::int64_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// The square of a third of the plane's shorter side (32 voxels at least) with the largest
/// standard deviation, on a lattice of half its side.
Detail busiest_detail(const report::Slice& plane);

/// The same plane (0: xy, 1: xz, 2: yz) of every volume. PNG files go to `folder`.
std::vector<report::HtmlFigure> plane_figures(const std::vector<Shown>& volumes, std::size_t plane,
                                              const report::GreyScale& scale,
                                              const std::filesystem::path& folder);
/// The detail of every xy plane, likewise.
std::vector<report::HtmlFigure> detail_figures(const std::vector<Shown>& volumes,
                                               const Detail& detail, const report::GreyScale& scale,
                                               const std::filesystem::path& folder);
/// Densities along x through the middle of the detail; distances in Å, or voxels without size.
std::vector<report::Curve> detail_profiles(const std::vector<Shown>& volumes, const Detail& detail,
                                           double voxel_size_A);

}  // namespace tomofield::compare
