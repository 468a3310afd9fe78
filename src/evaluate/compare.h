#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "evaluate/box.h"
#include "evaluate/psnr.h"
#include "evaluate/ssim.h"
#include "evaluate/volume_pair.h"

namespace tomofield::evaluate {

/// The scores of one volume against another.
struct Comparison {
  PsnrScore psnr;
  SsimScore ssim;
  base::Box box;  ///< the voxels compared, in the truth's coordinates
};

/// Scores the first volume of a pair against the second, the truth. The peak of the PSNR is the
/// truth's.
Comparison compare(const VolumePair& pair);

/// Returns the comparison as JSON. An infinite PSNR is written as null.
nlohmann::json comparison_json(const Comparison& comparison,
                               const std::filesystem::path& reconstruction,
                               const std::filesystem::path& truth);

}  // namespace tomofield::evaluate
