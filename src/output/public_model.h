#pragma once

#include <vector>

#include "field/sampling/sample_box.h"
#include "output/model_file.h"
#include "tomofield/model.h"
#include "tomofield/tomogram.h"

namespace tomofield {

/// Makes a public model, whose constructor is private.
struct ModelAccess {
  static Model make(output::Model model);
  static const output::Model& model(const Model& model);
};

/// Returns a box of a public model as the field takes it. Throws Error for sizes below 1 and for
/// numbers that are not finite.
field::OrientedBox oriented_box(const SampleBox& box);

namespace output {

/// Turns densities into values of the input's units and contrast, or of the inverted contrast.
void to_output(const ModelInfo& model, std::vector<float>& values, bool invert = false);

/// Samples the region of interest at the voxels that write_volume() writes, as floats in the order
/// z, y, x. `invert` turns their contrast.
Tomogram sample_tomogram(const Model& model, bool invert);

}  // namespace output
}  // namespace tomofield
