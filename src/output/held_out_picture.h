#pragma once

#include <filesystem>

#include "measurement/held_out.h"

namespace tomofield::output {

/// Writes a picture (PNG) of a held-out view. Three panels lie side by side: the measured view, the
/// predicted view and the residual (measured − predicted). They share one grey scale: black to
/// white spans the middle 99 % of the measured values. The scale is shifted for the residual, so
/// that zero is the middle grey. Pixels that are not measurements are black. Throws Error if `path`
/// cannot be written.
void write_held_out_picture(const std::filesystem::path& path,
                            const measurement::PredictedView& view);

}  // namespace tomofield::output
