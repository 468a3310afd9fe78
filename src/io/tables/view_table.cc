#include "io/tables/view_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "tomofield/error.h"

namespace tomofield::io {
namespace {

std::string extension_of(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace

double distance_from_middle_px(CentreRule rule, std::int64_t num_pixels) {
  const auto size = static_cast<double>(num_pixels);
  const double centre =
      rule == CentreRule::kWholePixel ? static_cast<double>(num_pixels / 2) : size / 2;
  return centre - (size - 1) / 2;
}

bool has_defocus(const ViewTable& table) {
  return std::ranges::all_of(table.views, [](const ListedView& view) {
    return !view.is_used || view.defocus.has_value();
  });
}

bool is_view_table(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  return extension == ".star" || extension == ".tomostar" || extension == ".xml";
}

ViewTable read_view_table(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  ViewTable table = extension == ".tomostar" ? read_warp_tomostar(path)
                    : extension == ".xml"    ? read_warp_xml(path)
                                             : read_relion_views(path);
  if (table.views.empty())
    throw Error(fmt::format("'{}' lists no views: give the table of a tilt series", path.string()));
  return table;
}

}  // namespace tomofield::io
