#pragma once

#include <filesystem>

#include "output/volume_frame.h"

namespace tomofield::output {

/// Returns how far the specimen of a model was found to be from level by the alignment of its
/// run, which lies beside the model (NAME_align.json of NAME.h5). Throws Error if there is none, or
/// if it could not tell.
Levelling found_levelling(const std::filesystem::path& model);

}  // namespace tomofield::output
