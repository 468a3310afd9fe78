#pragma once

#include <cstddef>
#include <vector>

#include "base/range.h"
#include "plan/memory_estimate.h"
#include "plan/tiles.h"

namespace tomofield::plan {

/// Decides whether the region is fitted by tiles, and by which: as --tile-rows says, or with
/// --budget by the highest ones that the memory of this machine is enough for, unless it is enough
/// for the whole region. A run that resumes goes on as it began, however much memory is free now.
/// Throws Error if --tile-rows is given and the region cannot be fitted by tiles, or if the files
/// that it resumes from cannot be read.
TilePlan plan_tiles(const PlannedFit& planned);

}  // namespace tomofield::plan
