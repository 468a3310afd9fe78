#pragma once

#include "geometry/tilt_geometry.h"
#include "reconstruct/options.h"

namespace tomofield::baseline {

/// Returns the defaults of TensoRF (Chen et al. 2022) as options of the main method: vector–matrix
/// factors, coarse to fine in several steps, total variation of the smooth kind, no boundary
/// consistency.
Options tensorf_defaults();

/// Resolves the options as reconstruction::run_options() does, for a tree without levels.
reconstruction::ReconstructOptions tensorf_options(const SeriesFiles& files,
                                                   const Options& options);

/// Makes the one node as large as the region. Throws Error if the region is larger than a node can
/// be.
void cover_with_one_node(const geometry::Roi& roi, reconstruction::ReconstructOptions& options);

}  // namespace tomofield::baseline
