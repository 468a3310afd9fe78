#pragma once

#include <filesystem>

#include "field/sampling/sample_box.h"
#include "output/model_file.h"
#include "tomofield/model.h"

namespace tomofield::output {

/// Returns how far the specimen of a model was found to be from level by the alignment of its
/// run, which lies beside the model (NAME_align.json of NAME.h5). An angle below three of its
/// standard errors is 0. The log says which angles they are. Throws Error if there is no such file,
/// if it is of another series than the model, or if it could not tell an angle. `file` is that of
/// `model`.
Levelling found_levelling(const ModelInfo& model, const std::filesystem::path& file);

/// The place of the volume that reconstruct writes, or of one that is brought level, in the field
/// of a model. A point P of the volume lies in the field at
///
///   C + D Ry(pitch) Rx(alpha - x_tilt) D (P − C),    D = diag(1, 1, hand)
///
/// where C is the point about which specimens are tilted and alpha is the x-axis tilt of the model
/// (docs/geometry.md). Lengths are pixels; pixel i covers [i, i + 1).
class VolumeFrame {
 public:
  explicit VolumeFrame(const ModelInfo& model, const Levelling& levelling = {});

  const field::Point& centre() const { return centre_; }
  field::Point to_field(const field::Point& point) const;
  /// Returns where a box of the volume lies in the field.
  field::OrientedBox to_field(const field::OrientedBox& box) const;
  /// Undoes to_field(). A box that lies along the axes of the volume is so exactly.
  field::OrientedBox from_field(const field::OrientedBox& box) const;

 private:
  field::Point centre_;
  field::Rotation field_from_volume_;
};

}  // namespace tomofield::output
