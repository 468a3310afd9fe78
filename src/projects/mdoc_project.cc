#include <fmt/format.h>

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "io/is_file.h"
#include "io/tables/alignment_files.h"
#include "io/tables/mdoc_images.h"
#include "projects/formats.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
using io::is_file;
namespace {

// Returns the stack beside an .mdoc file: "TS.st" for "TS.st.mdoc" and for "TS.mdoc", or what the
// entry ImageFile names.
std::optional<fs::path> find_stack(const fs::path& mdoc, const std::string& image_file) {
  fs::path stem = mdoc;
  stem.replace_extension();
  if (is_file(stem)) return stem;
  for (const char* extension : {".mrc", ".st", ".mrcs", ".tif", ".tiff"}) {
    const fs::path stack = stem.string() + extension;
    if (is_file(stack)) return stack;
  }
  const fs::path named = mdoc.parent_path() / image_file;
  return !image_file.empty() && is_file(named) ? std::optional(named) : std::nullopt;
}

}  // namespace

void read_mdoc_project(Project& project) {
  const fs::path mdoc = project.request().path;
  const io::Mdoc contents = io::read_mdoc(mdoc);
  if (const auto stack = find_stack(mdoc, contents.image_file)) {
    project.set("stack", stack->string(), mdoc, "ImageFile");
  } else {
    io::open_mdoc_images(mdoc, mdoc.parent_path());  // throws Error if it cannot
    project.set("stack", mdoc.string(), mdoc, "SubFramePath");
  }
  project.set("--mdoc", mdoc.string(), mdoc, "ZValue");
}

}  // namespace tomofield::projects
