#pragma once

#include <filesystem>
#include <optional>

#include "base/volume.h"
#include "evaluate/face_jump.h"

namespace tomofield::evaluate {

/// The faults of a reconstruction that its volume shows.
struct Artefacts {
  std::optional<double> speckle;  ///< none if the volume is too thin (speckle.h)
  std::optional<FaceJump> faces;  ///< none without a model, and if its leaves have no faces
};

/// Computes the artefacts of a volume that was read from `path`. The leaves are those of `model`
/// or else of the model that lies beside the volume (NAME.h5 for NAME.mrc), if there is one of the
/// volume's geometry. Throws Error for voxels that are not finite, and for a given model that
/// cannot be read or has another geometry.
Artefacts find_artefacts(const base::Volume& volume, const std::filesystem::path& path,
                         const std::optional<std::filesystem::path>& model);

}  // namespace tomofield::evaluate
