#pragma once

#include "output/model_file.h"
#include "tomofield/model.h"
#include "tomofield/tomogram.h"

namespace tomofield {

/// Makes a public model, whose constructor is private.
struct ModelAccess {
  static Model make(output::Model model);
};

namespace output {

/// Samples the region of interest at the voxels that write_volume() writes, as floats in the order
/// z, y, x. `invert` turns their contrast.
Tomogram sample_tomogram(const Model& model, bool invert);

}  // namespace output
}  // namespace tomofield
