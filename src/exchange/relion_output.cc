#include "exchange/relion_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/log.h"
#include "exchange/relion_alignment.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "io/images/view_images.h"
#include "io/is_file.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_set.h"
#include "io/tables/relion_star.h"
#include "output/output_paths.h"
#include "tilt_series/series_plan.h"
#include "tomofield/error.h"

namespace tomofield::exchange {

namespace fs = std::filesystem;
namespace {

// The entry of a tomograms.star by which the stack was found (projects/relion_project.cc).
constexpr const char* kEntry = "rlnTomoTiltSeriesStarFile";
constexpr const char* kTomogram = "rlnTomoReconstructedTomogram";

const Setting* find_origin(const options::ReconstructOptions& options) {
  const auto found = std::ranges::find(options.settings, kEntry, &Setting::entry);
  return found == options.settings.end() ? nullptr : &*found;
}

// Returns the row of the tilt series that was reconstructed. Several rows may name the same file.
std::size_t find_row(const io::RelionTomograms& all, const Setting& origin) {
  for (std::size_t row = 0; row < all.tomograms.size(); ++row) {
    const io::RelionTomogram& tomogram = all.tomograms[row];
    if (tomogram.name == origin.row &&
        io::find_listed_file(tomogram.tilt_series_star, origin.file) == origin.value)
      return row;
  }
  throw Error(fmt::format(
      "'{}' has no tomogram '{}' with '{}' any more: it has changed since the run began",
      origin.file.string(), origin.row, origin.value));
}

// Says whether the views have places that the table of the project does not state. A table of new
// places is written after an alignment.
bool are_views_elsewhere(const options::ReconstructOptions& options) {
  const SeriesFiles& files = options.files;
  const bool has_others = files.tlt || files.xf || files.aln || files.xtilt || files.local ||
                          options.views.tilt_offset_deg != 0 || options.views.x_axis_tilt_deg != 0;
  return has_others && !relion_alignment(options);
}

// Says whether the table's size of a pixel is not the one that is used.
bool are_pixels_others(const options::ReconstructOptions& options) {
  const auto stated_A = tilt_series::project_pixel_size_A(options.settings);
  return stated_A && stated_A != options.views.pixel_size_A;
}

// Says why RELION could not use the volume, or nothing if it can.
const char* obstacle(const options::ReconstructOptions& options) {
  if (options.volume.axes != VolumeAxes::kXyz) return "its axes are not in the order xyz";
  if (options.specimen.roi) return "it is a part of the specimen (--roi)";
  if (options.specimen.axis_x || options.specimen.axis_z || options.specimen.shift_z != 0)
    return "its middle is not the point about which the series is aligned";
  if (options.specimen.hand != 1) return "it is mirrored in Z (--hand -1)";
  if (are_pixels_others(options)) return "its pixels are not those of the project (--pixel-size)";
  if (are_views_elsewhere(options))
    return "its views have other angles or places than in the project's table (with --align, a "
           "table of the views as aligned is written)";
  return nullptr;
}

// Removes a file when the results get their names.
void remove_with_commit(const fs::path& file) {
  if (io::OutputSet* const results = io::OutputSet::active()) results->remove_old(file);
}

// Returns the name of a file from the project's folder, as RELION takes names; an absolute one if
// it lies elsewhere. An empty root is the current folder.
std::string name_from(const fs::path& root, const fs::path& file) {
  if (root.empty()) return file.string();
  const fs::path absolute = fs::absolute(file).lexically_normal();
  const fs::path name = absolute.lexically_relative(fs::absolute(root).lexically_normal());
  return name.empty() || *name.begin() == ".." ? absolute.string() : name.string();
}

// Names the linear halves if the run wrote them. RELION compares half maps and trains denoisers
// with them, which needs independent errors: the errors of fitted halves are alike. Halves that
// another program named belong to another tomogram.
void set_halves(const fs::path& volume, const fs::path& root, io::StarTable& table) {
  const io::OutputSet* const results = io::OutputSet::active();
  const output::OutputPaths paths = output::output_paths(volume);
  for (const std::size_t half : {0, 1}) {
    const std::string column = fmt::format("{}Half{}", kTomogram, half + 1);
    const fs::path& linear = paths.halves[half].linear_volume;
    if (results != nullptr && results->contains(linear))
      table.set(0, column, name_from(root, linear));
    else
      table.remove(column);
  }
}

}  // namespace

std::optional<fs::path> relion_output(const options::ReconstructOptions& options) {
  if (!relion_tomogram(options)) return std::nullopt;
  return output::output_paths(options.run.output).tomogram_star;
}

std::optional<std::string> relion_tomogram(const options::ReconstructOptions& options) {
  const Setting* const origin = find_origin(options);
  if (origin == nullptr || obstacle(options) != nullptr) return std::nullopt;
  return origin->row;
}

std::optional<io::StarTable> read_relion_output(const fs::path& volume) {
  const fs::path star = output::output_paths(volume).tomogram_star;
  if (!io::is_file(star)) return std::nullopt;
  try {
    for (const io::StarTable& table : io::read_star_file(star)) {
      const auto named = table.num_rows() == 1 ? table.find(0, kTomogram) : std::nullopt;
      if (named && fs::path(*named).filename() == volume.filename()) return table;
    }
  } catch (const Error&) {
    // The file is of something else.
  }
  return std::nullopt;
}

void write_relion_output(const options::ReconstructOptions& options, const fs::path& volume) {
  const Setting* const origin = find_origin(options);
  const fs::path path = options.run.output;
  if (!relion_output(options) && read_relion_output(path))
    remove_with_commit(output::output_paths(path).tomogram_star);
  if (origin == nullptr) return;
  if (const char* const why = obstacle(options)) {
    base::log_warning(
        fmt::format("no STAR file is written for RELION beside '{}': {}", path.string(), why));
    return;
  }
  const io::RelionTomograms all = io::read_relion_tomograms(origin->file);
  const std::size_t row = find_row(all, *origin);
  const io::MrcHeader header = io::MrcReader(volume).header();
  const double voxel_A = io::cubic_voxel_size_A(header, volume);
  const double binning = voxel_A / all.tomograms[row].pixel_size_A.value_or(voxel_A);
  io::StarTable table = all.table.only({row});
  table.set(0, "rlnTomoTomogramBinning", fmt::format("{:.6f}", binning));
  const auto unbinned = [&](std::int64_t voxels) {
    return std::to_string(std::llround(static_cast<double>(voxels) * binning));
  };
  table.set(0, "rlnTomoSizeX", unbinned(header.nx));
  table.set(0, "rlnTomoSizeY", unbinned(header.ny));
  table.set(0, "rlnTomoSizeZ", unbinned(header.nz));
  const fs::path root = io::root_of_listed_file(all.tomograms[row].tilt_series_star, origin->file);
  const std::string name = name_from(root, path);
  if (const auto aligned = relion_alignment(options))
    table.set(0, kEntry, name_from(root, *aligned));
  table.set(0, kTomogram, name);
  set_halves(path, root, table);
  // Programs know the denoised tomogram by either name; RELION 5 by the second.
  table.set(0, "rlnTomoDenoisedTomogram", name);
  table.set(0, "rlnTomoReconstructedTomogramDenoised", name);
  io::write_text_file(*relion_output(options), io::star_file_text(table));
}

}  // namespace tomofield::exchange
