#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/images/image_stack.h"
#include "io/images/view_images.h"
#include "io/tables/relion_star.h"
#include "io/tables/text_lines.h"
#include "io/tables/view_table.h"
#include "projects/formats.h"
#include "projects/stacks.h"
#include "projects/transfer_files.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
namespace {

std::string names_of(const std::vector<io::RelionTomogram>& tomograms) {
  constexpr std::size_t kMostNames = 8;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < std::min(tomograms.size(), kMostNames); ++i)
    names.push_back(tomograms[i].name);
  if (tomograms.size() > kMostNames) names.emplace_back("…");
  return fmt::format("{}", fmt::join(names, ", "));
}

// Returns the tomogram of --series, or the only one.
const io::RelionTomogram& choose_tomogram(const std::vector<io::RelionTomogram>& tomograms,
                                          const Request& request) {
  if (request.series.empty() && tomograms.size() == 1) return tomograms.front();
  const auto found = std::ranges::find(tomograms, request.series, &io::RelionTomogram::name);
  if (std::ranges::count(tomograms, request.series, &io::RelionTomogram::name) > 1) {
    throw Error(fmt::format("'{}' has several rows with the rlnTomoName '{}': give each its own",
                            request.path.string(), request.series));
  }
  if (found != tomograms.end()) return *found;
  throw Error(request.series.empty()
                  ? fmt::format("'{}' has {} tomograms, {}: name one with --series",
                                request.path.string(), tomograms.size(), names_of(tomograms))
                  : fmt::format("'{}' has no tomogram '{}' (--series); it has {}",
                                request.path.string(), request.series, names_of(tomograms)));
}

// Sets the hand of the defocus, which the table of the views states or the row that names it.
void set_hand(Project& project, const io::ViewTable& views, const io::RelionTomogram& row,
              const fs::path& star) {
  constexpr const char* kEntry = "rlnTomoHand";
  if (views.defocus_hand && row.defocus_hand && *views.defocus_hand != *row.defocus_hand &&
      !project.ignores(kEntry))
    throw Error(fmt::format(
        "'{}', tomogram {}: _{} is another than in '{}': correct one of them, or go on with "
        "--ignore {}",
        star.string(), row.name, kEntry, views.file.string(), kEntry));
  const auto& hand = row.defocus_hand ? row.defocus_hand : views.defocus_hand;
  if (hand)
    project.set("--defocus-hand", fmt::format("{}", *hand), row.defocus_hand ? star : views.file,
                kEntry);
}

// Sets what a table of one tilt series says, and tells whether it has the defocus of its views.
bool set_views(Project& project, const fs::path& views, const fs::path& named_by,
               std::string_view entry, const io::RelionTomogram& row) {
  const io::ViewTable table = io::read_view_table(views);
  for (const io::ImageInFile& image : io::find_view_images(table)) project.add_file(image.file);
  project.set("stack", views.string(), named_by, entry, row.name);
  const bool has_defocus = set_transfer_of_views(project, table, "rlnDefocusU");
  if (has_defocus || project.request().has_transfer) set_hand(project, table, row, named_by);
  return has_defocus;
}

// Notes the table of a tomogram, which results must not replace.
void add_table_of(Project& project, const io::RelionTomogram& tomogram, const fs::path& star) {
  try {
    project.add_file(io::find_listed_file(tomogram.tilt_series_star, star));
  } catch (const Error&) {
    // The table is not there, so no result replaces it.
  }
}

// Sets the transfer function of the detector that the row of a tomogram names.
void set_detector(Project& project, const io::RelionTomogram& tomogram, const fs::path& star) {
  constexpr const char* kEntry = "rlnMtfFileName";
  if (tomogram.mtf.empty() || project.ignores(kEntry)) return;
  try {
    project.set("--mtf", io::find_listed_file(tomogram.mtf, star).string(), star, kEntry);
  } catch (const Error& absent) {
    throw Error(fmt::format("{}, or go on without it with --ignore {}", absent.what(), kEntry));
  }
  constexpr double kSamePixel = 0.01;
  const auto recorded_A = tomogram.recorded_pixel_A, views_A = tomogram.pixel_size_A;
  if (recorded_A && views_A && std::abs(*recorded_A / *views_A - 1.0) > kSamePixel)
    project.warn(fmt::format(
        "'{}', tomogram {}: the detector's transfer counts for pixels of {:.6g} Å "
        "(rlnMicrographOriginalPixelSize), and is taken for those of the views of {:.6g} Å",
        star.string(), tomogram.name, *recorded_A, *views_A));
}

// Warns if a tomogram's pixels are not those of its images.
void warn_of_other_pixels(Project& project, const fs::path& views, const fs::path& star,
                          double stated_A) {
  const double in_header_A = io::open_image_stack(views)->header().voxel_size_A[0];
  if (!are_other_pixels(stated_A, in_header_A)) return;
  project.warn(
      fmt::format("'{}' states pixels of {:.6g} Å (rlnTomoTiltSeriesPixelSize), and the "
                  "images of '{}' of {:.6g} Å: the former is taken (--pixel-size)",
                  star.string(), stated_A, views.string(), in_header_A));
}

}  // namespace

void read_relion_project(Project& project) {
  const fs::path star = project.request().path;
  if (!io::lists_tomograms(star)) {
    require_no_series(project.request());
    set_views(project, star, star, "rlnMicrographName", {});
    return;
  }
  const io::RelionTomograms all = io::read_relion_tomograms(star);
  const auto& tomograms = all.tomograms;
  const io::RelionTomogram& tomogram = choose_tomogram(tomograms, project.request());
  const fs::path views = io::find_listed_file(tomogram.tilt_series_star, star);
  for (const io::RelionTomogram& other : tomograms) add_table_of(project, other, star);
  const bool has_transfer = set_views(project, views, star, "rlnTomoTiltSeriesStarFile", tomogram);
  const bool may_transfer = has_transfer || project.request().has_transfer;
  set_stated_optics(project, tomogram.optics, star,
                    {"rlnVoltage", "rlnSphericalAberration", "rlnAmplitudeContrast"}, may_transfer);
  if (may_transfer && !project.request().has_detector) set_detector(project, tomogram, star);
  for (const std::string& what : tomogram.not_applied)
    project.warn(fmt::format("'{}', tomogram {}: {}, which is not applied", star.string(),
                             tomogram.name, what));
  if (all.remark) project.warn(fmt::format("'{}': {}", star.string(), *all.remark));
  if (tomogram.defocus_slope.value_or(1.0) != 1.0)
    project.warn(
        fmt::format("'{}', tomogram {}: _rlnTomoDefocusSlope {} is not applied: the "
                    "defocus changes with the height as it is",
                    star.string(), tomogram.name, *tomogram.defocus_slope));
  if (tomogram.pixel_size_A) {
    if (!project.request().pixel_size_A)
      warn_of_other_pixels(project, views, star, *tomogram.pixel_size_A);
    project.set("--pixel-size", fmt::format("{}", *tomogram.pixel_size_A), star,
                "rlnTomoTiltSeriesPixelSize");
  }
  if (tomogram.size_px) {
    project.set("--thickness", fmt::format("{}", (*tomogram.size_px)[2]), star, "rlnTomoSizeZ");
  }
}

}  // namespace tomofield::projects
