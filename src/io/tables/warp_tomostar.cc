#include <fmt/format.h>

#include <array>
#include <string_view>

#include "io/tables/star_file.h"
#include "io/tables/unknown_entries.h"
#include "io/tables/view_table.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

// The first six columns are read. The others hold what Warp measured of the images.
constexpr std::array<std::string_view, 8> kKnownColumns{
    "wrpMovieName",   "wrpAngleTilt", "wrpAxisAngle",        "wrpAxisOffsetX",
    "wrpAxisOffsetY", "wrpDose",      "wrpAverageIntensity", "wrpMaskedFraction"};

}  // namespace

// Warp projects a point of the specimen by Rz(axis angle) Ry(−angle) and adds the offset
// (WarpLib's TiltSeries.GetPositionInAllTilts with Matrix3.Euler). `ts_import` negates the angles
// of the microscope, so that −wrpAngleTilt is the tilt angle as IMOD has it.
ViewTable read_warp_tomostar(const std::filesystem::path& path) {
  const std::vector<StarTable> tables = read_star_file(path);
  if (tables.size() != 1) {
    throw Error(fmt::format("'{}' has {} tables, but a .tomostar of Warp has one", path.string(),
                            tables.size()));
  }
  ViewTable views{path, CentreRule::kHalfSize, true, {}, {}, {}};
  for (std::size_t i = 0; i < tables.front().num_rows(); ++i) {
    const StarRow row(path, tables.front(), i);
    ListedView view;
    view.image = row.text("wrpMovieName");
    view.tilt_deg = -row.number("wrpAngleTilt", base::kLargestAngle_deg);
    view.rotation_deg =
        row.find_stated_number("wrpAxisAngle", base::kLargestAngle_deg).value_or(0.0);
    view.shift_x_A =
        row.find_stated_number("wrpAxisOffsetX", base::kLargestPosition_px).value_or(0.0);
    view.shift_y_A =
        row.find_stated_number("wrpAxisOffsetY", base::kLargestPosition_px).value_or(0.0);
    view.dose_before = row.find_dose("wrpDose");
    views.views.push_back(std::move(view));
  }
  if (!tables.front().has_column("wrpAxisOffsetX"))
    views.remarks.emplace_back(
        "it has no shifts, so the views are aligned only by angles; "
        "the XML file of an aligned series has them");
  if (const auto remark = remark_on_unknown(unknown_columns(tables.front(), kKnownColumns)))
    views.remarks.push_back(*remark);
  return views;
}

}  // namespace tomofield::io
