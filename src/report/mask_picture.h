#pragma once

#include <filesystem>

#include "tilt_series/tilt_series.h"

namespace tomofield::report {

/// A picture of the view of lowest tilt, dense parts dark, y upwards, with what
/// is masked in it tinted red: one look tells whether beads and fill were
/// found. Small views are enlarged, whole pixels a pixel. Replaces the file.
void write_mask_picture(const tilt_series::TiltSeries& series, const std::filesystem::path& path);

}  // namespace tomofield::report
