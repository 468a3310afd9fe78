#pragma once

#include <cstddef>
#include <vector>

#include "base/range.h"

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

}  // namespace tomofield::plan
