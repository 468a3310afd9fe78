#pragma once

#include <cstddef>
#include <vector>

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

enum class Lines { kColumns, kRows };

constexpr std::size_t kLineParts = 16;

/// Profiles of the columns or rows of one view, one for each of kLineParts parts of their length:
/// [part][line]. NaN stands where most pixels of a part are no measurements.
using LineProfiles = std::vector<std::vector<float>>;

/// Returns how much each column (or row) lies above those around it, in each part of its length:
/// the mean over the part's pixels less a running median over up to 15 lines.
LineProfiles line_profiles(const MaskedImage& image, Lines lines);

}  // namespace tomofield::tilt_series
