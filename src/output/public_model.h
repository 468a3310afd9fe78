#pragma once

#include <filesystem>
#include <vector>

#include "field/sampling/sample_box.h"
#include "output/model_file.h"
#include "tomofield/model.h"
#include "tomofield/tomogram.h"

namespace tomofield {

/// Makes a public model, whose constructor is private.
struct ModelAccess {
  /// `file` is that of the model; empty: it is in memory alone.
  static Model make(output::Model model, std::filesystem::path file);
  static const output::Model& model(const Model& model);
  static const std::filesystem::path& file(const Model& model);
};

/// Returns a box of a public model as the field takes it. Throws Error for sizes below 1 and for
/// numbers that are not finite.
field::OrientedBox oriented_box(const SampleBox& box);

/// Throws Error for a size of voxels that is not finite or not above 0.
void require_usable_voxels(double voxel_px);

namespace output {

/// Turns densities into values of the input's units and contrast, or of the inverted contrast.
void to_output(const ModelInfo& model, std::vector<float>& values, bool invert = false);

/// Returns a box of a model in memory, whose densities are `values`.
Tomogram to_tomogram(const ModelInfo& model, const field::OrientedBox& box,
                     std::vector<float> values, bool invert);

/// Samples the region of interest at the voxels that write_volume() writes, as floats in the order
/// z, y, x. `invert` turns their contrast.
Tomogram sample_tomogram(const Model& model, bool invert);

}  // namespace output
}  // namespace tomofield
