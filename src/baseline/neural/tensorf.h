#pragma once

#include "reconstruct/options.h"
#include "tomofield/options.h"

namespace tomofield::baseline {

/// Returns TensoRF (Chen et al. 2022) as options of the main method: the vector–matrix factors of
/// one node that covers the whole region of interest, coarse to fine in several steps, and a total
/// variation with the smooth penalty. It has no leaves, no boundary consistency and no concave
/// penalty.
reconstruction::ReconstructOptions tensorf_options();

/// Makes the one node as large as the region. Throws Error if the region is larger than a node can
/// be.
void cover_with_one_node(const Rectangle& roi, reconstruction::ReconstructOptions& options);

}  // namespace tomofield::baseline
