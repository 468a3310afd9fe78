#include <fmt/format.h>

#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include "io/images/image_stack.h"
#include "io/is_file.h"
#include "io/tables/text_lines.h"
#include "projects/formats.h"
#include "projects/stacks.h"
#include "projects/transfer_files.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
using io::is_file;
namespace {

using Entries = std::map<std::string, std::string, std::less<>>;

// Reads the lines "Setup.DatasetName=TS_01"; comments begin with '#'.
Entries read_entries(const fs::path& edf) {
  Entries entries;
  for (const io::TextLine& line : io::read_text_lines(edf)) {
    const std::size_t equals = line.text.find('=');
    if (line.text.starts_with('#') || equals == std::string::npos) continue;
    const std::string_view text = line.text, value = io::trim(text.substr(equals + 1));
    const auto [entry, is_new] = entries.emplace(io::trim(text.substr(0, equals)), value);
    if (!is_new && entry->second != value)
      throw Error(fmt::format("'{}', line {}: {} comes twice, as '{}' and '{}': leave one out",
                              edf.string(), line.number, io::quote(entry->first),
                              io::quote(entry->second), io::quote(value)));
  }
  return entries;
}

std::string value_of(const Entries& entries, std::string_view name) {
  const auto found = entries.find(name);
  return found == entries.end() ? std::string() : found->second;
}

// Returns the first of the files NAME + ending that is there.
template <std::size_t kCount>
std::optional<fs::path> first_file(const fs::path& stem, std::array<const char*, kCount> endings) {
  for (const char* ending : endings)
    if (const fs::path file = stem.string() + ending; is_file(file)) return file;
  return std::nullopt;
}

// The tilt axis, as eTomo's dialog of a new dataset has it.
struct ImageRotation {
  const char* entry;
  double angle_deg;
};

// Returns the tilt axis that a dataset states, unless the user ignores it. Old versions write one
// for both axes of a dataset.
std::optional<ImageRotation> find_rotation(Project& project, const fs::path& edf,
                                           const Entries& entries) {
  const char* const entry =
      entries.contains("Setup.ImageRotationA") ? "Setup.ImageRotationA" : "Setup.ImageRotation";
  const std::string text = value_of(entries, entry);
  if (text.empty() || project.ignores(entry)) return std::nullopt;
  constexpr double kWholeTurn_deg = 360.0;
  if (const auto axis_deg = io::parse_number(text, base::kLargestAngle_deg))
    return ImageRotation{entry, std::remainder(double{*axis_deg}, kWholeTurn_deg)};
  throw Error(
      fmt::format("'{}': {} is '{}', which is no angle of a tilt axis: correct it, or go "
                  "on with --ignore {}",
                  edf.string(), entry, io::quote(text), entry));
}

void compare_axis(Project& project, const fs::path& edf, const Entries& entries) {
  if (const auto rotation = find_rotation(project, edf, entries))
    warn_of_other_rotation(project, edf, rotation->entry, rotation->angle_deg);
}

// Sets the tilt axis of a dataset that is not aligned yet.
void set_axis(Project& project, const fs::path& edf, const Entries& entries) {
  const auto rotation = find_rotation(project, edf, entries);
  if (!rotation) return;
  project.set("--tilt-axis", fmt::format("{}", rotation->angle_deg), edf, rotation->entry);
  project.warn(
      fmt::format("'{}' is not aligned yet (no .xf): without --align full its views are turned by "
                  "the image rotation, and not shifted",
                  edf.string()));
}

double pixel_size_A(const fs::path& stack) {
  return io::open_image_stack(stack)->header().voxel_size_A[0];
}

// Sets the pixel size, which eTomo writes in nm, if the stack has none.
void set_pixel_size(Project& project, const fs::path& edf, const Entries& entries,
                    double in_header_A) {
  constexpr const char* kEntry = "Setup.PixelSize";
  constexpr double kAngstroms_in_nm = 10.0;
  const std::string text = value_of(entries, kEntry);
  if (text.empty() || project.ignores(kEntry) || !project.value_of("--pixel-size").empty()) return;
  const auto size_nm = io::parse_number(text);
  if (!size_nm)
    throw Error(fmt::format(
        "'{}': {} is '{}', which is no size of a pixel: correct it, or go on with --ignore {}",
        edf.string(), kEntry, io::quote(text), kEntry));
  if (*size_nm > 0)
    set_stated_pixel_size(project, {edf, kEntry, kAngstroms_in_nm * *size_nm}, in_header_A);
}

// Warns of tilts that a dataset states itself, and of which eTomo has made no file.
void warn_of_stated_tilts(Project& project, const fs::path& edf, const Entries& entries) {
  constexpr const char* kEntry = "Setup.AxisA.TiltAngle.Type";
  const std::string type = value_of(entries, kEntry);
  if ((type != "Range" && type != "List") || project.ignores(kEntry)) return;
  project.warn(fmt::format(
      "'{}' states the tilts of its views ({} is {}), which are not read: write them into a file "
      "and give it with --tlt (--ignore {} says that others are meant)",
      edf.string(), kEntry, type, kEntry));
}

// Sets the files that eTomo names after a dataset, whose alignment may not be there yet.
void set_dataset(Project& project, const fs::path& edf, const Entries& entries,
                 const std::string& name) {
  constexpr const char* kEntry = "Setup.DatasetName";
  const fs::path stem = edf.parent_path() / name;
  const std::string ending = value_of(entries, "Setup.RawImageStackExt");
  const std::string stated = ending.empty() ? ".st" : "." + ending;
  const auto stack = first_file(stem, std::array{stated.c_str(), ".st", ".mrc", "_raw.mrc"});
  if (!stack) {
    throw Error(fmt::format(
        "'{0}' names the dataset '{1}', and neither tilt.com nor '{1}.st' lies beside it: give a "
        "stack itself with its options",
        edf.string(), name));
  }
  project.set("stack", stack->string(), edf, kEntry);
  if (const auto tlt = first_file(stem, std::array{".tlt", ".rawtlt"}))
    project.set("--tlt", tlt->string(), edf, kEntry);
  else
    warn_of_stated_tilts(project, edf, entries);
  if (const fs::path xf = stem.string() + ".xf"; is_file(xf)) {
    project.set("--xf", xf.string(), edf, kEntry);
    compare_axis(project, edf, entries);
  } else {
    set_axis(project, edf, entries);
  }
  constexpr const char* kExcluded = "Setup.AxisA.ExcludeProjections";
  if (const std::string excluded = value_of(entries, kExcluded); !excluded.empty())
    project.set("--exclude", excluded, edf, kExcluded);
  for (const char* entry : {"Setup.DistortionFile", "Setup.MagGradientFile"})
    if (const std::string file = value_of(entries, entry); !file.empty() && !project.ignores(entry))
      project.warn(fmt::format(
          "'{}': {} names '{}', which is not applied (--ignore {} says that this is meant)",
          edf.string(), entry, io::quote(file), entry));
  const bool has_defocus = set_transfer_files(project, edf.parent_path(), name);
  const double in_header_A = pixel_size_A(*stack);
  set_imod_optics(project, edf.parent_path() / "tilt.com", {.in_header_A = in_header_A},
                  has_defocus || project.request().has_transfer);
  set_pixel_size(project, edf, entries, in_header_A);
  if (const fs::path xtilt = stem.string() + ".xtilt"; is_file(xtilt))
    project.set("--xtilt", xtilt.string(), edf, kEntry);
}

// Throws Error if tilt.com is of another dataset.
void require_same_dataset(const Project& project, const fs::path& edf, const std::string& name) {
  const fs::path stack = project.value_of("stack");
  std::string rest = stack.filename().string();
  if (rest.starts_with(name)) {
    rest.erase(0, name.size());
    if (rest.starts_with('a') || rest.starts_with('b')) rest.erase(0, 1);  // one of two axes
    if (name.empty() || rest.empty() || rest[0] == '.' || rest[0] == '_') return;
  }
  throw Error(
      fmt::format("'{}' is of the dataset '{}', and the tilt.com beside it reads '{}': give the "
                  "tilt.com or the stack that you mean",
                  edf.string(), name, stack.string()));
}

}  // namespace

void read_edf_project(Project& project) {
  const fs::path edf = project.request().path;
  const fs::path tilt = edf.parent_path() / "tilt.com";
  const Entries entries = read_entries(edf);
  if (is_file(tilt)) {
    project.add_file(tilt);
    read_imod_project(project, tilt);
    require_same_dataset(project, edf, value_of(entries, "Setup.DatasetName"));
    // The size is that of the raw stack.
    if (!project.value_of("--xf").empty())
      set_pixel_size(project, edf, entries, pixel_size_A(project.value_of("stack")));
    return compare_axis(project, edf, entries);
  }
  const std::string name = value_of(entries, "Setup.DatasetName");
  if (name.empty()) {
    throw Error(fmt::format(
        "'{}' names no dataset (Setup.DatasetName): give the folder's tilt.com, or a stack itself",
        edf.string()));
  }
  if (value_of(entries, "Setup.AxisType").starts_with("Dual")) {
    throw Error(
        fmt::format("'{}' is of two axes, which are reconstructed one by one: name tilta.com or "
                    "tiltb.com, which eTomo writes, or give a stack itself with its options",
                    edf.string()));
  }
  if (value_of(entries, "Setup.ViewType").starts_with("Montage")) {
    throw Error(fmt::format(
        "'{}' is of a montage, whose pieces are not read: blend them in eTomo, and give that stack",
        edf.string()));
  }
  set_dataset(project, edf, entries, name);
}

}  // namespace tomofield::projects
