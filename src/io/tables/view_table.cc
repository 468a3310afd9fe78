#include "io/tables/view_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <string_view>

#include "io/lower_extension.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {

double distance_from_middle_px(CentreRule rule, std::int64_t num_pixels) {
  const auto size = static_cast<double>(num_pixels);
  const double centre =
      rule == CentreRule::kWholePixel ? static_cast<double>(num_pixels / 2) : size / 2;
  return centre - (size - 1) / 2;
}

void require_possible(const StatedOptics& optics, const std::filesystem::path& file) {
  constexpr base::Interval kAberrations_mm{0, 20}, kContrasts{0, 1};
  const auto require = [&](std::optional<double> value, base::Interval within,
                           std::string_view what) {
    if (!value || within.find(*value)) return;
    throw Error(fmt::format("'{}': {} of {} cannot be, from {:g} to {:g} is possible: correct it",
                            file.string(), what, *value, within.low(), within.high()));
  };
  require(optics.voltage_kV, kVoltages_kV, "a voltage in kV");
  require(optics.spherical_aberration_mm, kAberrations_mm, "a spherical aberration in mm");
  require(optics.amplitude_contrast, kContrasts, "an amplitude contrast");
}

bool has_defocus(const ViewTable& table) {
  return std::ranges::all_of(table.views, [](const ListedView& view) {
    return !view.is_used || view.defocus.has_value();
  });
}

bool is_view_table(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  return extension == ".star" || extension == ".tomostar" || extension == ".xml";
}

std::filesystem::path without_half(const std::filesystem::path& path) {
  const std::string name = path.string();
  for (const std::string_view half : {"even@", "odd@"})
    if (name.starts_with(half)) return name.substr(half.size());
  return path;
}

ViewTable read_view_table(const std::filesystem::path& table_or_half) {
  const std::filesystem::path path = without_half(table_or_half);
  const std::string extension = lower_extension(path);
  ViewTable table = extension == ".tomostar" ? read_warp_tomostar(path)
                    : extension == ".xml"    ? read_warp_xml(path)
                                             : read_relion_views(path);
  if (table.views.empty())
    throw Error(fmt::format("'{}' lists no views: give the table of a tilt series", path.string()));
  require_possible(table.optics, path);
  std::set<std::string_view> images;
  for (const ListedView& view : table.views)
    if (!images.insert(view.image).second)
      throw Error(fmt::format("'{}' lists the image '{}' for two views: leave one of them out",
                              path.string(), quote(view.image)));
  return table;
}

}  // namespace tomofield::io
