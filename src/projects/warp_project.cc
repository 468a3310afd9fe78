#include <fmt/format.h>

#include "io/images/mrc_format.h"
#include "io/images/view_images.h"
#include "io/lower_extension.h"
#include "io/tables/view_table.h"
#include "projects/formats.h"
#include "projects/stacks.h"
#include "projects/transfer_files.h"

namespace tomofield::projects {

namespace {

// Sets the pixel size, which the XML file states for the contrast transfer, if the images have
// none. Returns the one that counts in Å; 0 if there is none.
double set_pixel_size(Project& project, const io::ViewTable& table) {
  constexpr const char* kEntry = "PixelSize";
  const double in_header_A = io::open_image_stack(table.file)->header().voxel_size_A[0];
  const auto stated_A = table.optics.pixel_size_A;
  if (!stated_A || project.ignores(kEntry)) return in_header_A;
  const bool is_known = io::is_known_size(in_header_A);
  // Beside a contrast transfer, the size for which its defocus holds is compared there.
  if (!is_known || !(io::has_defocus(table) || project.request().pixel_size_A))
    set_stated_pixel_size(project, {table.file, kEntry, *stated_A}, in_header_A);
  return is_known ? in_header_A : *stated_A;
}

}  // namespace

void read_warp_project(Project& project) {
  const std::filesystem::path path = project.request().path;
  const io::ViewTable table = io::read_view_table(path);
  for (const io::ImageInFile& image : io::find_view_images(table)) project.add_file(image.file);
  const bool is_xml = io::lower_extension(path) != ".tomostar";
  project.set("stack", path.string(), path, is_xml ? "MoviePath" : "wrpMovieName");
  const bool has_defocus = set_transfer_of_views(project, table, "GridCTF");
  const bool may_transfer = has_defocus || project.request().has_transfer;
  set_stated_optics(project, table.optics, path, {"Voltage", "Cs", "Amplitude"}, may_transfer);
  if (may_transfer && table.defocus_hand)
    project.set("--defocus-hand", fmt::format("{}", *table.defocus_hand), path,
                "AreAnglesInverted");
  const double stated_A = set_pixel_size(project, table);
  const double pixel_A = project.request().pixel_size_A.value_or(stated_A);
  if (table.thickness_A && pixel_A > 0) {
    project.set("--thickness", fmt::format("{:.0f}", *table.thickness_A / pixel_A), path,
                "VolumeDimensionsAngstrom");
  }
}

}  // namespace tomofield::projects
