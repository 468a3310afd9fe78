#include <fmt/format.h>

#include "io/images/view_images.h"
#include "io/tables/view_table.h"
#include "projects/formats.h"
#include "projects/transfer_files.h"

namespace tomofield::projects {

void read_warp_project(Project& project) {
  const std::filesystem::path path = project.request().path;
  const io::ViewTable table = io::read_view_table(path);
  for (const io::ImageInFile& image : io::find_view_images(table)) project.add_file(image.file);
  const bool is_xml = path.extension() != ".tomostar";
  project.set("stack", path.string(), path, is_xml ? "MoviePath" : "wrpMovieName");
  if (io::has_defocus(table)) {
    project.set("--ctf", path.string(), path, "GridCTF");
    if (table.defocus_hand) {
      project.set("--defocus-hand", fmt::format("{}", *table.defocus_hand), path,
                  "AreAnglesInverted");
    }
  } else {
    warn_of_unused_transfer(project, table);
  }
  if (!table.thickness_A) return;
  const double pixel_A = io::open_image_stack(path)->header().voxel_size_A[0];
  if (pixel_A > 0) {
    project.set("--thickness", fmt::format("{:.0f}", *table.thickness_A / pixel_A), path,
                "VolumeDimensionsAngstrom");
  }
}

}  // namespace tomofield::projects
