#pragma once

#include <span>
#include <vector>

#include "base/range.h"
#include "tilt_series/fixed_pattern/line_profiles.h"

namespace tomofield::tilt_series {

/// Finds what lines of the views have in common that stays at one place of the detector, whatever
/// lies in the beam. Returns how much to subtract in each view, [view][line] in the units of the
/// views, or nothing if there is no pattern.
///
/// `views` are the profiles of every view. `group_of_view` divides the views into groups between
/// which the specimen moves, counted from 0. Lines in `unmoved` do not count for whether there is a
/// pattern, since the specimen stays there as well.
///
/// Up to four patterns are found one after another, each with a strength for every view. The
/// strengths are the first left singular vector of the profiles. There is a pattern if the second
/// differences of profiles of different groups and different parts, weighted by the strengths,
/// agree at the same place of the detector: by eight standard errors over the parts, and 1.5 times
/// better than if one of them is moved by 8 lines or more. What a specimen has in common is smooth
/// and does not prefer a place of the detector. The pattern is the mean over groups and parts. Each
/// line of it is shrunk by the variance between parts, and then each view's strength by its own
/// (James and Stein).
std::vector<std::vector<float>> find_line_patterns(std::vector<LineProfiles> views,
                                                   std::span<const int> group_of_view,
                                                   base::Range unmoved);

}  // namespace tomofield::tilt_series
