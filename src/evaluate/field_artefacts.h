#pragma once

#include <optional>
#include <vector>

#include "base/range.h"
#include "distributed/communicator.h"
#include "evaluate/face_jump.h"
#include "field/field.h"
#include "tomofield/options.h"

namespace tomofield::evaluate {

/// The faults of a fit that its region shows, and how its density varies along z.
struct FieldArtefacts {
  std::vector<double> section_mean, section_deviation;  ///< [z], in density units
  double deviation = 0.0;                               ///< standard deviation of all voxels
  double skewness = 0.0;          ///< third central moment of all voxels over deviation³
  std::optional<double> speckle;  ///< as of a volume (speckle.h)
  std::optional<FaceJump> faces;  ///< as of a volume (face_jump.h)
};

/// Computes the artefacts of a field's voxels in a region, one voxel a pixel over the whole
/// thickness, in the frame of the field. The voxels are decoded twice, some rows at a time, so that
/// no volume is in memory.
///
/// Each process works on `rows` of its own, counted from the region's first, and needs the density
/// of one more row on either side. `rows` begin at a multiple of 16 and lie in slabs of the fit.
/// All processes get the same result, with the same bits for any number of processes and threads.
FieldArtefacts find_artefacts(
    const field::Field& field, const Rectangle& region, base::Range rows,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::evaluate
