#include "exchange/relion_alignment.h"

#include "output/output_paths.h"

#include <cstddef>
#include <numbers>
#include <vector>

#include "io/lower_extension.h"
#include "io/saving/atomic_file.h"
#include "io/tables/relion_star.h"
#include "io/tables/view_table.h"
#include "output/alignment_files.h"
#include "tilt_series/planned_series.h"
#include "tilt_series/section_table.h"

namespace tomofield::exchange {

namespace fs = std::filesystem;
namespace {

// Returns how a view of the series is aligned, in pixels before binning. RELION has the tilt axis
// in the middle.
tilt_series::AlignedSection aligned_section(const tilt_series::PlannedSeries& series,
                                            std::size_t view, double axis_px) {
  const tilt_series::View& seen = series.views()[view];
  const geometry::RawFromAligned map = output::map_from_axis(series, view, axis_px);
  return {seen.tilt_deg, seen.x_tilt_deg, map.rotation_rad() * 180.0 / std::numbers::pi, map, 0};
}

}  // namespace

std::optional<fs::path> relion_alignment(const options::ReconstructOptions& options) {
  if (options.run.align == Alignment::kOff || options.images ||
      io::lower_extension(options.files.stack) != ".star")
    return std::nullopt;
  return output::output_paths(options.run.output).alignment_star;
}

void write_relion_alignment(const tilt_series::PlannedSeries& series,
                            const options::ReconstructOptions& options) {
  const std::optional<fs::path> path = relion_alignment(options);
  if (!path) return;
  const io::ViewTable listed = io::read_relion_views(options.files.stack);
  const double pixel_size_A = series.plan().listed_pixel_size_A;
  const double axis_px = output::tilt_axis(series, options.specimen).from_middle_px;
  std::vector<std::size_t> sections;
  for (const tilt_series::View& view : series.views())
    sections.push_back(static_cast<std::size_t>(view.section));
  io::StarTable table = io::read_relion_rows(options.files.stack).only(sections);
  for (std::size_t view = 0; view < sections.size(); ++view) {
    io::ListedView aligned = listed.views.at(sections[view]);
    tilt_series::set_alignment(aligned_section(series, view, axis_px), listed.centre,
                               series.stack().header(), pixel_size_A, aligned);
    io::set_relion_alignment(aligned, view, table);
  }
  io::write_text_file(*path, io::star_file_text(table));
}

}  // namespace tomofield::exchange
