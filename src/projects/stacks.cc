#include "projects/stacks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "io/images/image_stack.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "io/is_file.h"
#include "io/lower_extension.h"
#include "tilt_series/contradictions.h"
#include "tilt_series/series_plan.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
namespace {

constexpr std::array kExtensions{".mrc", ".st", ".mrcs", ".tif", ".tiff"};

// A file that cannot be read may be the stack: the error says so when it is opened.
bool is_stack(const fs::path& path) {
  if (!io::is_file(path)) return false;
  try {
    return !io::is_own_volume(io::open_image_stack(path)->header());
  } catch (const Error&) {
    return true;
  }
}

}  // namespace

std::optional<fs::path> find_stack_beside(const fs::path& file, const std::string& named) {
  fs::path stem = file;
  stem.replace_extension();
  if (is_stack(stem)) return stem;
  if (const fs::path stack = file.parent_path() / named; !named.empty() && is_stack(stack))
    return stack;
  for (const char* extension : kExtensions)
    if (const fs::path stack = stem.string() + extension; is_stack(stack)) return stack;
  return std::nullopt;
}

std::string series_name_beside(const fs::path& file) {
  const fs::path stem = file.stem();
  const bool is_stack_name = std::ranges::count(kExtensions, io::lower_extension(stem)) > 0 ||
                             io::is_file(file.parent_path() / stem);
  return (is_stack_name ? stem.stem() : stem).string();
}

bool are_other_pixels(double stated_A, double in_header_A) {
  constexpr double kCalibration = 0.1;
  return io::is_known_size(in_header_A) && std::fabs(stated_A / in_header_A - 1.0) > kCalibration;
}

void set_stated_pixel_size(Project& project, const StatedPixelSize& stated, double in_header_A) {
  if (project.ignores(stated.entry)) return;
  if (!io::is_known_size(in_header_A)) {
    project.set("--pixel-size", fmt::format("{:.6g}", stated.size_A), stated.file, stated.entry);
  } else if (are_other_pixels(stated.size_A, in_header_A)) {
    project.warn(
        fmt::format("'{}' states pixels of {:.6g} Å ({}), and the stack of {:.6g} Å: the "
                    "latter is taken (give the right size with --pixel-size)",
                    stated.file.string(), stated.size_A, stated.entry, in_header_A));
  }
}

void warn_of_other_rotation(Project& project, const fs::path& file, const std::string& entry,
                            double angle_deg) {
  const std::string xf = project.value_of("--xf");
  if (xf.empty() || project.ignores(entry)) return;
  const double axis_deg =
      tilt_series::axis_of_transforms(xf, *io::open_image_stack(project.value_of("stack")));
  const tilt_series::StatedAxis stated{angle_deg, fmt::format("{} of '{}'", entry, file.string())};
  if (const auto found = tilt_series::contradiction_of_axis(stated, axis_deg, xf))
    project.warn(*found);
}

}  // namespace tomofield::projects
