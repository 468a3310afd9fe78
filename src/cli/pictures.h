#pragma once

#include <filesystem>

#include "tilt_series/tilt_series.h"

namespace tomofield::cli {

/// Writes pictures of the central slices of a volume (report/slice.h) and of the masks of its
/// series (report/pictures.h), and prints their paths. `bead_masking` says what the run did with
/// the beads.
void write_pictures(const std::filesystem::path& volume, const tilt_series::TiltSeries& series,
                    tilt_series::BeadMasking bead_masking, const std::filesystem::path& prefix);

/// Writes a picture of a model's leaves (report/pictures.h) and prints its path.
void write_tree_picture(const std::filesystem::path& model, const std::filesystem::path& picture);

}  // namespace tomofield::cli
