#include "io/tables/ctf_table.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/lower_extension.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

// Tells whether a text file has the comments that CTFFIND and AreTomo write above their columns.
bool has_ctffind_comments(const std::filesystem::path& path) {
  return std::ranges::any_of(read_text_lines(path), [](const TextLine& line) {
    return line.text.starts_with('#') && line.text.find("defocus 1") != std::string::npos;
  });
}

CtfTable read_any(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  if (extension == ".star") return read_relion_ctf(path);
  if (extension == ".xml") return read_warp_ctf(path);
  return has_ctffind_comments(path) ? read_ctffind(path) : read_imod_defocus(path);
}

}  // namespace

CtfTable read_ctf(const std::filesystem::path& path) {
  CtfTable table = read_any(path);
  require_possible(table.optics, path);
  const bool has_any = std::ranges::any_of(
      table.views, [](const std::optional<Defocus>& defocus) { return defocus.has_value(); });
  if (!has_any) {
    throw Error(
        fmt::format("'{}' has no defocus of any view: give a file that lists them", path.string()));
  }
  return table;
}

// Warp estimates the contrast transfer of a tilt series into the grids of its XML file.
CtfTable read_warp_ctf(const std::filesystem::path& path) {
  const ViewTable series = read_warp_xml(path);
  CtfTable table{path, {}, series.optics, series.ctf_not_applied};
  table.defocus_hand = series.defocus_hand;
  for (const ListedView& view : series.views) {
    table.images.push_back(view.image);
    table.dose_before.push_back(view.dose_before);
    table.views.push_back(view.defocus);
    table.tilt_deg.emplace_back(view.tilt_deg);
  }
  return table;
}

}  // namespace tomofield::io
