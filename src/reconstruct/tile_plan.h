#pragma once

#include <cstddef>
#include <vector>

#include "base/range.h"
#include "reconstruct/memory_estimate.h"
#include "reconstruct/tiles.h"

namespace tomofield::reconstruction {

/// Decides whether the region is fitted by tiles, and by which: as --tile-rows says, or with
/// --budget by the highest ones that the memory of this machine is enough for, unless it is enough
/// for the whole region. Throws Error if --tile-rows is given and the region cannot be fitted by
/// tiles.
TilePlan plan_tiles(const PlannedFit& planned);

}  // namespace tomofield::reconstruction
