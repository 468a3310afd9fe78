#include "reconstruct/relion_alignment.h"

#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <vector>

#include "io/atomic_file.h"
#include "io/relion_star.h"
#include "io/view_table.h"
#include "tilt_series/open_views.h"
#include "tilt_series/section_table.h"

namespace tomofield::reconstruction {

namespace fs = std::filesystem;
namespace {

// Returns how a view of the series is aligned, in pixels before binning.
tilt_series::AlignedSection aligned_section(const tilt_series::TiltSeries& series,
                                            std::size_t view) {
  const tilt_series::View& seen = series.views()[view];
  const geometry::RawFromAligned map =
      series.raw_from_aligned(view).binned(1.0 / series.bin_factor());
  const double rotation_rad = std::atan2(map.m21 - map.m12, map.m11 + map.m22);
  return {seen.tilt_deg, seen.x_tilt_deg, rotation_rad * 180.0 / std::numbers::pi, map, 0};
}

// Returns a table of the same columns without rows.
io::StarTable without_rows(const io::StarTable& table) { return {table.name(), table.columns()}; }

std::vector<std::string> cells_of(const io::StarTable& table, std::size_t row) {
  std::vector<std::string> cells;
  for (const std::string& column : table.columns()) cells.push_back(*table.find(row, column));
  return cells;
}

}  // namespace

std::optional<fs::path> relion_alignment(const ReconstructOptions& options) {
  if (options.resolved.align == Alignment::kOff || options.input.images ||
      options.input.stack.extension() != ".star")
    return std::nullopt;
  return output_paths(options.resolved.output).alignment.replace_extension(".star");
}

void write_relion_alignment(const tilt_series::TiltSeries& series,
                            const ReconstructOptions& options) {
  const std::optional<fs::path> path = relion_alignment(options);
  if (!path) return;
  const io::StarTable rows = io::read_relion_rows(options.input.stack);
  const io::ViewTable listed = io::read_relion_views(options.input.stack);
  const auto stack = tilt_series::open_views(options.input);
  const double pixel_size_A = series.pixel_size_A() / series.bin_factor();
  io::StarTable table = without_rows(rows);
  for (std::size_t view = 0; view < series.views().size(); ++view) {
    const auto section = static_cast<std::size_t>(series.views()[view].section);
    io::ListedView aligned = listed.views.at(section);
    tilt_series::set_alignment(aligned_section(series, view), listed.centre, stack->header(),
                               pixel_size_A, aligned);
    table.add_row(cells_of(rows, section));
    io::set_relion_alignment(aligned, view, table);
  }
  io::write_text_file(*path, io::star_file_text(table));
}

}  // namespace tomofield::reconstruction
