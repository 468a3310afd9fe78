#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "evaluate/box.h"
#include "evaluate/psnr.h"
#include "evaluate/ssim.h"
#include "evaluate/volume_pair.h"

namespace tomofield::evaluate {

/// Score of one volume against another.
struct Comparison {
  PsnrScore psnr;
  SsimScore ssim;
  Box box;  ///< the voxels compared, in the truth's coordinates
};

/// Scores two volumes of one shape; the peak is that of the second, the truth.
Comparison compare(const VolumePair& pair);

/// The comparison as JSON; an infinite PSNR is written as null.
nlohmann::json comparison_json(const Comparison& comparison,
                               const std::filesystem::path& reconstruction,
                               const std::filesystem::path& truth);

}  // namespace tomofield::evaluate
