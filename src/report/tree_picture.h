#pragma once

#include <filesystem>

#include "output/model_file.h"

namespace tomofield::report {

/// Where a model's leaves are: the central XY slice of its region of interest in
/// grey (x to the right, y upwards; greys as in write_slice_pictures(), densities
/// as the model holds them) with the leaves' borders over it in orange. Enlarged by
/// whole pixels like the other pictures; a border is one picture pixel wide, on
/// the inner side of a leaf's lower x and y faces. Replaces `path`. Throws Error.
void write_tree_picture(const output::Model& model, const std::filesystem::path& path);

}  // namespace tomofield::report
