#include <fmt/format.h>

#include "io/tables/alignment_files.h"
#include "projects/formats.h"
#include "projects/stacks.h"
#include "projects/transfer_files.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
namespace {

// Returns the stack beside an .aln file: AreTomo3 writes it under the same name, and AreTomo2
// names the .aln file after it.
fs::path find_stack(const fs::path& aln) {
  if (const auto stack = find_stack_beside(aln, {})) return *stack;
  fs::path expected = aln;
  expected.replace_extension(".mrc");
  throw Error(fmt::format(
      "'{}' is AreTomo's alignment, and the stack that it aligns is not beside it as '{}': give "
      "the stack itself, with --aln {}",
      aln.string(), expected.filename().string(), aln.string()));
}

}  // namespace

void read_aretomo_project(Project& project) {
  const fs::path aln = project.request().path;
  const io::AreTomoAlignment alignment = io::read_aretomo_alignment(aln, /*needs_tilt=*/false);
  project.set("stack", find_stack(aln).string(), aln, "RawSize");
  project.set("--aln", aln.string(), aln, "SEC");
  set_transfer_files(project, aln.parent_path(), series_name_beside(aln));
  if (alignment.thickness)
    project.set("--thickness", fmt::format("{}", *alignment.thickness), aln, "Thickness");
  if (alignment.alpha_offset_deg != 0) {
    project.warn(fmt::format("'{}': the tilts of its rows include AlphaOffset, {}°, already",
                             aln.string(), alignment.alpha_offset_deg));
  }
}

}  // namespace tomofield::projects
