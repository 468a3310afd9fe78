#pragma once

#include <filesystem>

#include "tilt_series/tilt_series.h"

namespace tomofield::report {

/// Draws the view of lowest tilt with its masked pixels in red, so that one look tells whether
/// beads and fill were found. Dense parts are dark; y runs upwards. Small views are enlarged by
/// whole pixels. Replaces the file.
void write_mask_picture(const tilt_series::TiltSeries& series, const std::filesystem::path& path);

}  // namespace tomofield::report
