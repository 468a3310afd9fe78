#pragma once

#include "plan/tile_plan.h"
#include "reconstruct/results.h"
#include "reconstruct/run.h"

namespace tomofield::reconstruction {

/// Makes a compact reconstruction whose vertices are never in memory all at once. The coarse stages
/// are fitted for the whole region. Then one tile of rows after the other is fitted to the end,
/// from the vertices that the coarse stages left and with their scales of the views, and its own
/// rows are replaced by codes. Rows beside the tile are fitted with it and thrown away, so that its
/// own rows have neighbours as in a fit of the whole region. The volume is sampled from the codes.
///
/// A stopped run goes on with --resume after the coarse stages' last checkpoint, or after the last
/// tile that was finished.
RunResult fit_by_tiles(const Run& run, const plan::TilePlan& plan, FitRecord& record);

}  // namespace tomofield::reconstruction
