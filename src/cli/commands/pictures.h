#pragma once

#include <filesystem>
#include <vector>

#include "tilt_series/tilt_series.h"

namespace tomofield::cli {

/// Writes pictures of the central slices of a volume (report/slice.h) and of the masks of its
/// series (report/pictures.h), and returns their paths. `bead_masking` says what the run did with
/// the beads.
std::vector<std::filesystem::path> write_pictures(const std::filesystem::path& volume,
                                                  const tilt_series::TiltSeries& series,
                                                  tilt_series::BeadMasking bead_masking,
                                                  const std::filesystem::path& prefix);

/// Prints the paths of pictures.
void print_pictures(const std::vector<std::filesystem::path>& pictures);

}  // namespace tomofield::cli
