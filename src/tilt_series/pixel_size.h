#pragma once

#include <optional>

#include "io/images/image_stack.h"
#include "io/images/mrc_format.h"
#include "io/tables/alignment_files.h"
#include "tilt_series/series_plan.h"

namespace tomofield::tilt_series {

/// Returns the facts of a stack that is an MRC file.
std::optional<io::MrcFacts> facts_of(const TiltSeriesOptions& options, const io::ImageStack& stack);

/// Returns the size of an unbinned pixel in Å: --pixel-size, else the header's, else the .mdoc's.
/// Throws Error for pixels that are not square, and for sizes that cannot be.
double find_pixel_size(const TiltSeriesOptions& options, const io::ImageStack& stack,
                       const std::optional<io::Mdoc>& mdoc);

/// Warns of what the header of a stack, or its .mdoc, states twice, and differently.
void warn_of_headers(const TiltSeriesOptions& options, const io::ImageStack& stack,
                     const std::optional<io::Mdoc>& mdoc);

}  // namespace tomofield::tilt_series
