#include <fmt/format.h>

#include "io/tables/alignment_files.h"
#include "io/tables/mdoc_images.h"
#include "projects/formats.h"
#include "projects/stack_beside.h"
#include "projects/transfer_files.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
namespace {

// Sets the defocus that the session aimed at, which nobody has measured. It needs a pixel size.
void set_target_defocus(Project& project, const fs::path& file, const io::Mdoc& mdoc) {
  const auto underfocus_um = io::target_underfocus_um(mdoc);
  if (underfocus_um && mdoc.pixel_spacing_A)
    project.set("--defocus", fmt::format("{}", *underfocus_um), file, "TargetDefocus");
}

}  // namespace

void read_mdoc_project(Project& project) {
  const fs::path mdoc = project.request().path;
  const io::Mdoc contents = io::read_mdoc(mdoc);
  if (const auto stack = find_stack_beside(mdoc, contents.image_file)) {
    project.set("stack", stack->string(), mdoc, "ImageFile");
  } else {
    io::open_mdoc_images(mdoc, mdoc.parent_path());  // throws Error if it cannot
    project.set("stack", mdoc.string(), mdoc, "SubFramePath");
  }
  project.set("--mdoc", mdoc.string(), mdoc, "ZValue");
  fs::path stem = mdoc.stem();
  if (stem.has_extension()) stem = stem.stem();  // "TS_01" of "TS_01.mrc.mdoc"
  if (!set_transfer_files(project, mdoc.parent_path(), stem.string()))
    set_target_defocus(project, mdoc, contents);
  if (contents.voltage_kV)
    project.set("--voltage", fmt::format("{}", *contents.voltage_kV), mdoc, "Voltage");
}

}  // namespace tomofield::projects
