#pragma once

#include "geometry/tilt_geometry.h"
#include "tilt_series/planned_series.h"
#include "tomofield/options.h"

namespace tomofield::baseline {

/// Returns the defaults of TensoRF (Chen et al. 2022) as options of the main method: vector–matrix
/// factors, coarse to fine in several steps, total variation of the smooth kind, no boundary
/// consistency. The tree is one node (one_node_size()).
Options tensorf_defaults();

/// Returns the side of one node that covers a region, in pixels. Slabs of pixels that are binned
/// by `coarse_bin` end with the node; a small region bins fewer pixels. Throws Error if the region
/// is larger than a node can be.
int one_node_size(const Rectangle& roi, int coarse_bin);

/// Returns the side of one node for the region of a run.
int one_node_size(const tilt_series::PlannedSeries& series, const Options& options);

}  // namespace tomofield::baseline
