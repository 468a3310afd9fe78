#include "projects/imod_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "tomofield/error.h"

namespace tomofield::projects {
namespace {

// Positions here are unbinned pixels of IMOD from the left (or lower) edge of the views as this
// program makes them. Its formulas are those of tilt's source: with W the width of the aligned
// stack, the tilt axis is at FULLIMAGE/2 − SUBSETSTART + (second OFFSET) of it, and column i of the
// volume at zero tilt is i + W/2 − WIDTH/2 − SHIFT.

// One side of a rectangle that the volume covers.
struct Side {
  double low = 0, high = 0;
};

// Joins the names of entries that a setting follows from.
std::string join(const std::vector<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string text_of(double value) { return fmt::format("{}", value); }

// Returns the part of a side that is in the view. Throws Error if there is none.
Side clipped(const Side& side, double size, const std::string& entries, Project& project,
             const CommandEntries& tilt, double bin) {
  const Side inside{std::max(side.low, 0.0), std::min(side.high, size)};
  if (!(inside.low < inside.high)) {
    throw Error(
        fmt::format("'{}': with {} the volume has no part in the views: correct them, or "
                    "go on with --ignore",
                    tilt.file().string(), entries));
  }
  const double beyond = std::max(inside.low - side.low, side.high - inside.high);
  if (beyond >= bin) {
    project.warn(
        fmt::format("'{}': with {} the volume would reach {:g} unbinned pixels beyond the "
                    "views: it ends with them",
                    tilt.file().string(), entries, beyond));
  }
  return inside;
}

void set_roi(Project& project, CommandEntries& tilt, const ImodImages& images, double shift_x) {
  std::vector<std::string> entries;
  const double left = images.width / 2 + images.imod_offset_x - images.imod_width / 2;
  const double bottom = images.height / 2 + images.imod_offset_y - images.imod_height / 2;
  if (images.imod_width != images.width || images.imod_height != images.height)
    entries.push_back(images.size_entry);
  if (images.has_newst && (images.imod_offset_x != 0 || images.imod_offset_y != 0))
    entries.emplace_back("OffsetsInXandY");
  const bool is_of_newst = images.has_newst && !entries.empty();
  Side x{left - shift_x, left - shift_x + images.imod_width};
  Side y{bottom, bottom + images.imod_height};
  if (shift_x != 0) entries.emplace_back("SHIFT");
  if (const auto width = tilt.number("WIDTH")) {
    x.low += (images.imod_width - *width) / 2;
    x.high = x.low + *width;
    entries.emplace_back("WIDTH");
  }
  if (const auto slice = tilt.numbers("SLICE", 2, 3)) {
    y = {bottom + slice->at(0), bottom + slice->at(1) + 1};
    entries.emplace_back("SLICE");
    if (slice->size() > 2 && slice->at(2) != 1)
      project.warn(
          fmt::format("'{}': SLICE has steps of {:g} slices, which are not applied: the "
                      "volume has all slices from {:g} to {:g}",
                      tilt.file().string(), slice->at(2), slice->at(0), slice->at(1)));
  }
  if (entries.empty()) return;
  const std::string names = join(entries);
  x = clipped(x, images.width, names, project, tilt, images.bin);
  y = clipped(y, images.height, names, project, tilt, images.bin);
  // Sizes of binned images are rounded: less than a binned pixel at an edge is no part left out.
  const double cut = std::max({x.low, images.width - x.high, y.low, images.height - y.high});
  if (cut < images.bin) return;
  project.set("--roi",
              fmt::format("{},{},{},{}", std::llround(x.low / images.unit),
                          std::llround(y.low / images.unit), std::llround(x.high / images.unit),
                          std::llround(y.high / images.unit)),
              tilt.file(), is_of_newst ? names + " (with newst.com)" : names);
}

void set_center(Project& project, CommandEntries& tilt, const ImodImages& images,
                double axis_offset) {
  const auto full = tilt.sizes("FULLIMAGE");
  const auto start = tilt.numbers("SUBSETSTART", 2, 2, std::array{0.0, 0.0});
  if (start && !full && (start->at(0) != 0 || start->at(1) != 0)) {
    throw Error(
        fmt::format("'{}' has SUBSETSTART without FULLIMAGE, so the tilt axis cannot be "
                    "told: add it, or go on with --ignore SUBSETSTART",
                    tilt.file().string()));
  }
  const double left = images.width / 2 + images.imod_offset_x - images.imod_width / 2;
  const double bottom = images.height / 2 + images.imod_offset_y - images.imod_height / 2;
  double axis = left + images.imod_width / 2, middle = bottom + images.imod_height / 2;
  if (full && (start || !project.ignores("SUBSETSTART"))) {
    axis = left + full->at(0) / 2 - (start ? start->at(0) : 0.0);
    middle = bottom + full->at(1) / 2 - (start ? start->at(1) : 0.0);
  }
  axis += axis_offset;
  if (std::fabs(middle - images.height / 2) > images.bin &&
      tilt.number("XAXISTILT").value_or(0) != 0) {
    project.warn(
        fmt::format("'{}': FULLIMAGE and SUBSETSTART turn the volume about X {:g} unbinned "
                    "pixels beside the middle of the views, where this program turns it: "
                    "the specimen is shifted a little along Z",
                    tilt.file().string(), middle - images.height / 2));
  }
  // Both entries are rounded to binned pixels.
  const bool is_central = axis_offset == 0 && std::fabs(axis - images.width / 2) <= images.bin;
  if (is_central) return;
  project.set("--center", text_of(axis / images.unit), tilt.file(),
              axis_offset == 0 ? "FULLIMAGE, SUBSETSTART" : "OFFSET, FULLIMAGE, SUBSETSTART");
}

}  // namespace

void set_imod_volume(Project& project, CommandEntries& tilt, const ImodImages& images) {
  constexpr std::array kNoShift{0.0};
  // AreTomo writes 0 or -1 where it makes no volume.
  if (const auto thickness = tilt.number("THICKNESS"); thickness && *thickness > 0)
    project.set("--thickness", text_of(*thickness / images.unit), tilt.file(), "THICKNESS");
  const auto shift = tilt.numbers("SHIFT", 1, 2, kNoShift).value_or(std::vector<double>{0});
  // Rows of IMOD's slices go down along Z (docs/geometry.md).
  if (shift.size() > 1 && shift[1] != 0)
    project.set("--shift-z", text_of(-shift[1] / images.unit), tilt.file(), "SHIFT");
  set_roi(project, tilt, images, shift[0]);
  const auto offset = tilt.numbers("OFFSET", 1, 2, kNoShift).value_or(std::vector<double>{0});
  if (offset[0] != 0) project.set("--tilt-offset", text_of(offset[0]), tilt.file(), "OFFSET");
  set_center(project, tilt, images, offset.size() > 1 ? offset[1] : 0.0);
}

}  // namespace tomofield::projects
