#pragma once

#include <filesystem>

#include "measurement/held_out.h"

namespace tomofield::output {

/// Writes a picture (PNG) of a view that was held out: as measured, as predicted,
/// and what is left (measured − predicted), side by side. One grey scale for all
/// three: black to white spans the middle 99 % of the measured values, shifted
/// for the residual so that nothing left is the middle grey. Pixels that are not
/// measurements are black. Throws Error.
void write_held_out_picture(const std::filesystem::path& path,
                            const measurement::PredictedView& view);

}  // namespace tomofield::output
