#pragma once

#include <filesystem>

#include "evaluate/fsc.h"

namespace tomofield::report {

/// A plot of the shell correlation against frequency, labelled with resolutions, with grid
/// lines at 0, 0.143, 0.5 and 1: all Fourier voxels in black and, if they are told
/// apart, those within the tilt range in blue and those of the missing wedge
/// in orange. Replaces `path`. Throws Error.
void write_fsc_picture(const evaluate::Fsc& fsc, const std::filesystem::path& path);

}  // namespace tomofield::report
