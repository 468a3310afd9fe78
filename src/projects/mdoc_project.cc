#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "io/tables/alignment_files.h"
#include "io/tables/mdoc_images.h"
#include "projects/formats.h"
#include "projects/stacks.h"
#include "projects/transfer_files.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
namespace {

// Sets the defocus that the session aimed at, which nobody has measured. It needs a pixel size.
void set_target_defocus(Project& project, const fs::path& file, const io::Mdoc& mdoc) {
  const auto target = &io::MdocSection::target_defocus_um;
  std::vector<double> stated_um;
  for (const io::MdocSection& section : mdoc.sections)
    if (section.*target) stated_um.push_back(*(section.*target));
  if (stated_um.empty() || !mdoc.pixel_spacing_A || project.ignores("TargetDefocus")) return;
  const auto [lowest_um, highest_um] = std::ranges::minmax(stated_um);
  if (lowest_um == 0.0 && highest_um == 0.0) return;
  const auto underfocus_um = io::target_underfocus_um(mdoc);
  if (!underfocus_um || highest_um > 0.0) {
    project.warn(fmt::format(
        "'{}': TargetDefocus is from {} to {} µm, and images are recorded below focus, with less "
        "than 0: it is not applied (give --defocus, or --ctf)",
        file.string(), lowest_um, highest_um));
    return;
  }
  constexpr double kSpread_um = 0.2;  // less does not show in a tomogram
  if (highest_um - lowest_um > kSpread_um)
    project.warn(fmt::format(
        "'{}': TargetDefocus is from {} to {} µm, and its median is taken for all views (give "
        "--ctf with the defocus of each)",
        file.string(), lowest_um, highest_um));
  project.set("--defocus", fmt::format("{}", *underfocus_um), file, "TargetDefocus");
}

}  // namespace

void read_mdoc_project(Project& project) {
  const fs::path mdoc = project.request().path;
  const io::Mdoc contents = io::read_mdoc(mdoc);
  if (const auto stack = find_stack_beside(mdoc, contents.image_file)) {
    const bool is_named = stack->filename() == contents.image_file;
    project.set("stack", stack->string(), mdoc, is_named ? "ImageFile" : "its name");
  } else {
    io::find_mdoc_images(mdoc, mdoc.parent_path());  // throws Error if it cannot
    project.set("stack", mdoc.string(), mdoc, "SubFramePath");
  }
  project.set("--mdoc", mdoc.string(), mdoc, "ZValue");
  if (!set_transfer_files(project, mdoc.parent_path(), series_name_beside(mdoc)))
    set_target_defocus(project, mdoc, contents);
  if (contents.voltage_kV)
    project.set("--voltage", fmt::format("{}", *contents.voltage_kV), mdoc, "Voltage");
}

}  // namespace tomofield::projects
