#pragma once

#include <memory>

#include "io/images/image_stack.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::tilt_series {

/// Opens the images of a series: those in memory, those of the stack, or, if that is a folder,
/// those in it that the .mdoc names. Throws Error as io::open_image_stack() and
/// io::open_mdoc_images() do.
std::shared_ptr<const io::ImageStack> open_views(const TiltSeriesOptions& options);

}  // namespace tomofield::tilt_series
