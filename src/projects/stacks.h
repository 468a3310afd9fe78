#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "projects/project.h"

namespace tomofield::projects {

/// Returns the stack that belongs to a file of another program, "TS.aln", "TS.mdoc" or
/// "TS.st.mdoc", beside it: "TS.st" for the last, else `named`, the name that the file states
/// (empty: none), else the name of the file with the extension of a stack. A tomogram of this
/// program is none of them. Returns nothing if there is no stack.
std::optional<std::filesystem::path> find_stack_beside(const std::filesystem::path& file,
                                                       const std::string& named);

/// Returns the name of the series of a file that may be named after its stack: "TS_01" of
/// "TS_01.mdoc" and of "TS_01.mrc.mdoc". A part after a point that names no stack belongs to it.
std::string series_name_beside(const std::filesystem::path& file);

/// A pixel size that an entry of a file states.
struct StatedPixelSize {
  std::filesystem::path file;
  std::string entry;
  double size_A = 0.0;
};

/// Sets --pixel-size to what a file states if the header of the stack has no size (`in_header_A` is
/// 0 or 1). Warns if both differ by more than a tenth, which no calibration changes.
void set_stated_pixel_size(Project& project, const StatedPixelSize& stated, double in_header_A);

/// Returns whether the header of a stack has other pixels than those that are stated, and not only
/// another calibration. A header without a size has not.
bool are_other_pixels(double stated_A, double in_header_A);

/// Warns if the transforms that the project applies (--xf) turn the views of its stack by another
/// tilt axis than the one that an entry states. Does nothing without transforms.
void warn_of_other_rotation(Project& project, const std::filesystem::path& file,
                            const std::string& entry, double angle_deg);

}  // namespace tomofield::projects
