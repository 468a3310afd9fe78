#pragma once

#include <filesystem>
#include <memory>

#include "io/images/image_stack.h"

namespace tomofield::io {

/// Returns the images of the views of an .mdoc file, which lie in `folder` in a file each, in the
/// order of its sections. An image is named after the movie that it is the average of
/// (SubFramePath): "TS_01_003.mrc" or "TS_01_003_….mrc" (or .tif) for "D:\…\TS_01_003.eer". Upper
/// and lower case, and points and underscores, count as the same where no name is equal. Throws
/// Error for a section that names no movie, and if a movie has no image, or several.
std::vector<ImageInFile> find_mdoc_images(const std::filesystem::path& mdoc,
                                          const std::filesystem::path& folder);

/// Opens these images as a stack.
std::shared_ptr<const ImageStack> open_mdoc_images(const std::filesystem::path& mdoc,
                                                   const std::filesystem::path& folder);

}  // namespace tomofield::io
