#include "tilt_series/tilt_axis.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "io/images/mrc_format.h"
#include "io/tables/text_lines.h"
#include "option_table/values.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

constexpr double kVertical_deg = 1.0;
constexpr std::string_view kIgnoredEntry = "TiltAxisAngle";

bool ignores_axis(const TiltSeriesOptions& options) {
  return option_table::has_name(option_table::split_names(options.ignore), kIgnoredEntry);
}

// Tells whether the labels say that a program has moved the pixels of the recorded images.
bool is_transformed(const io::MrcHeader& header) {
  constexpr std::array<std::string_view, 4> kPrograms{"transformed", "blendmont", "mrctaper",
                                                      "tomofield"};
  return std::ranges::any_of(kPrograms,
                             [&](std::string_view word) { return io::is_in_labels(header, word); });
}

// Throws Error if titles among the labels state several tilt axes.
void require_one_title(const io::ImageStack& stack) {
  const std::vector<double> axes_deg = io::axes_of_labels(stack.header().labels);
  if (axes_deg.size() < 2 || is_transformed(stack.header())) return;
  throw Error(
      fmt::format("the labels of '{}' state a tilt axis of {:.6g}° and one of {:.6g}°: give the "
                  "right one with --tilt-axis",
                  stack.name(), axes_deg[0], axes_deg[1]));
}

std::string line_of(const std::filesystem::path& path, const io::AxisAngle& axis) {
  return fmt::format("'{}', line {}", path.string(), axis.line);
}

std::optional<StatedAxis> axis_of_mdoc(const std::filesystem::path& path, const io::Mdoc& mdoc,
                                       bool is_aligned) {
  if (mdoc.tilt_axis_deg)
    return StatedAxis{mdoc.tilt_axis_deg->value, line_of(path, *mdoc.tilt_axis_deg)};
  if (!mdoc.unclear_axis_deg || is_aligned) return std::nullopt;
  const double stated_deg = mdoc.unclear_axis_deg->value;
  throw Error(fmt::format(
      "{}: Tomography states TiltAxisAngle = {}°, which alone does not tell the tilt axis: it is "
      "{:.4g}° in most files. Give it with --tilt-axis, or --ignore TiltAxisAngle if the views are "
      "aligned already",
      line_of(path, *mdoc.unclear_axis_deg), stated_deg,
      std::remainder(-stated_deg - 90.0, 360.0)));
}

// Returns the axis that SerialEM's RotationAngle belongs to.
double axis_of_rotation_deg(const io::AxisAngle& rotation) {
  return std::remainder(rotation.value - 90.0, 360.0);
}

[[noreturn]] void refuse_lone_rotation(const std::filesystem::path& path,
                                       const io::AxisAngle& rotation) {
  throw Error(fmt::format(
      "{}: RotationAngle = {}° is stated without a tilt axis, which is {:.4g}° by the rule of "
      "SerialEM: give it with --tilt-axis, or --ignore TiltAxisAngle if the views are aligned "
      "already",
      line_of(path, rotation), rotation.value, axis_of_rotation_deg(rotation)));
}

}  // namespace

std::optional<StatedAxis> axis_of_lone_rotation(const TiltSeriesOptions& options,
                                                const io::Mdoc& mdoc) {
  if (!mdoc.lone_rotation_deg || ignores_axis(options)) return std::nullopt;
  const io::AxisAngle& rotation = *mdoc.lone_rotation_deg;
  return StatedAxis{axis_of_rotation_deg(rotation),
                    fmt::format("by the rule of SerialEM, RotationAngle = {}° of {}",
                                rotation.value, line_of(*options.mdoc, rotation))};
}

double angle_between_axes(double a_deg, double b_deg) {
  return std::fabs(std::remainder(a_deg - b_deg, 360.0));
}

std::optional<StatedAxis> axis_of_header(const io::ImageStack& stack) {
  const io::MrcHeader& header = stack.header();
  if (is_transformed(header)) return std::nullopt;
  const std::vector<double> titles_deg = io::axes_of_labels(header.labels);
  const auto axis_deg = titles_deg.empty() ? header.extended_axis_deg : titles_deg.front();
  if (!axis_deg) return std::nullopt;
  return StatedAxis{*axis_deg, fmt::format("the header of '{}'", stack.name())};
}

std::optional<StatedAxis> find_stated_axis(const TiltSeriesOptions& options,
                                           const io::ImageStack& stack,
                                           const std::optional<io::Mdoc>& mdoc, bool is_aligned) {
  if (options.tilt_axis_deg) return StatedAxis{*options.tilt_axis_deg, "--tilt-axis", true};
  if (ignores_axis(options)) return std::nullopt;
  std::optional<StatedAxis> axis;
  if (mdoc) axis = axis_of_mdoc(*options.mdoc, *mdoc, is_aligned);
  if (!axis) {
    if (!is_aligned) require_one_title(stack);
    axis = axis_of_header(stack);
  }
  if (!axis && mdoc && mdoc->lone_rotation_deg && !is_aligned && !is_transformed(stack.header()))
    refuse_lone_rotation(*options.mdoc, *mdoc->lone_rotation_deg);
  if (axis) axis->angle_deg = std::remainder(axis->angle_deg, 360.0);
  return axis;
}

void require_vertical(const StatedAxis& axis, const io::ImageStack& stack) {
  if (angle_between_axes(axis.angle_deg, 0.0) <= kVertical_deg) return;
  throw Error(
      fmt::format("{}: the tilt axis is turned by {:.6g}° from the vertical, so '{}' must be "
                  "aligned: `tomofield "
                  "reconstruct` and `align` begin with this axis if --align full is given, --xf or "
                  "--aln give an "
                  "alignment, and --ignore TiltAxisAngle says that its views are aligned already",
                  axis.source, axis.angle_deg, stack.name()));
}

}  // namespace tomofield::tilt_series
