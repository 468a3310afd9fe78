#pragma once

#include <filesystem>
#include <memory>

#include "io/images/image_stack.h"

namespace tomofield::io {

/// Returns true if the first bytes of a file are those of a TIFF file. Throws Error if it cannot be
/// read.
bool is_tiff(const std::filesystem::path& path);

/// Opens a TIFF file as a stack, one page a section: grey values of 8, 16 or 32 bits, integers or
/// floats, in any compression that libtiff knows. A page's first row is its top, so it becomes the
/// last row of the section, as IMOD and RELION do it. The pixel size is that of the resolution
/// tags, if they give one of a microscope. Throws Error for other pages, for pages of several
/// sizes, and for pages that are larger than the file can hold.
std::shared_ptr<const ImageStack> open_tiff_stack(const std::filesystem::path& path);

}  // namespace tomofield::io
