#pragma once

#include <cstddef>
#include <vector>

#include "base/range.h"
#include "plan/memory_estimate.h"

namespace tomofield::plan {

/// The rows of the region of interest that are fitted together, counted from its first one.
struct Tile {
  base::Range own;     ///< rows that the tile contributes
  base::Range fitted;  ///< these and the rows beside them, whose vertices are thrown away
};

/// The order of a fit by tiles: first the coarse stages of the whole region, then the other stages
/// of one tile after the other.
struct TilePlan {
  int num_whole_stages = 0;           ///< 0: there are no tiles
  int rows = 0;                       ///< of a tile, whole bands; the last one may have fewer
  int overlap = 0;                    ///< rows that are fitted beside those of a tile, on each side
  int num_rows = 0;                   ///< of the region
  std::size_t memory_bytes = 0;       ///< estimated peak
  std::size_t coarse_parameters = 0;  ///< vertices of the last stage of the whole region

  bool is_used() const { return num_whole_stages > 0; }
  /// Returns the tiles from a row on, with which one of them begins.
  std::vector<Tile> tiles_from(int first_row) const;
  /// Returns how many times as many rows are fitted as there are, in the stages of tiles.
  double repeats() const;
};

/// Decides whether the region is fitted by tiles, and by which: as --tile-rows says, or with
/// --budget by the highest ones that the memory of this machine is enough for, unless it is enough
/// for the whole region. A run that resumes goes on as it began, however much memory is free now.
/// Throws Error if --tile-rows is given and the region cannot be fitted by tiles, or if the files
/// that it resumes from cannot be read.
TilePlan plan_tiles(const PlannedFit& planned);

}  // namespace tomofield::plan
