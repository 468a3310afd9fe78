#pragma once

#include "geometry/tilt_geometry.h"
#include "reconstruct/options.h"

namespace tomofield::baseline {

/// TensoRF (Chen et al. 2022) as options of the main method: vector–matrix factors of one node
/// that covers the whole region of interest, coarse to fine in several steps, total variation of
/// the smooth kind; no leaves, no boundary consistency, no concave penalty.
reconstruction::ReconstructOptions tensorf_options();

/// Makes the one node as large as the region. Throws Error where that is more than a node's most.
void cover_with_one_node(const geometry::Roi& roi, reconstruction::ReconstructOptions& options);

}  // namespace tomofield::baseline
