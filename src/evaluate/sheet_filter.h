#pragma once

#include <filesystem>

#include "base/volume.h"
#include "evaluate/matching/detection.h"

namespace tomofield::evaluate {

/// Returns how much each voxel looks like a dense sheet, [z, y, x]: −λ₁ − |λ₂|, or 0 where that is
/// negative, where λ₁ <= λ₂ are the two smallest eigenvalues of the Hessian matrix of the volume
/// after a Gaussian blur. A sheet bends the density across it alone; a ball bends it in all
/// directions and gets 0. Derivatives are central differences; the volume goes on as its mirror
/// image. `sigma_px` is the blur's standard deviation in voxels. High is dense. Throws Error for
/// axes shorter than 3 voxels.
base::Volume sheet_response(const base::Volume& volume, double sigma_px);

/// Compares the sheets of a volume with the voxels that are labelled as membrane (above ½), which
/// have the same shape. The blur is 20 Å, about the optimum for a bilayer of 50 Å. Throws Error for
/// a label without membranes, and for an unknown voxel size.
DetectionScore membrane_score(const base::Volume& volume, const base::Volume& label);

}  // namespace tomofield::evaluate
