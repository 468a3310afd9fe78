#pragma once

#include <filesystem>

#include "output/model_file.h"

namespace tomofield::report {

/// Draws the leaves of a model: the central XY slice of its region of interest in grey (x to the
/// right, y upwards; greys as in write_slice_pictures(), densities as the model holds them), with
/// the borders of the leaves over it in orange. The picture is enlarged by whole pixels. A border
/// is one picture pixel wide, on the inner side of a leaf's lower x and y faces. Replaces `path`.
/// Throws Error if it cannot be written.
void write_tree_picture(const output::Model& model, const std::filesystem::path& path);

}  // namespace tomofield::report
