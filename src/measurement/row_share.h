#pragma once

#include <cstdint>

#include "base/range.h"
#include "distributed/communicator.h"

namespace tomofield::measurement {

/// The rows of a fit that a process works on.
///
/// A process owns the leaves of whole bands (rows of root cells) and the slabs of these rows. Where
/// whole bands would give some processes much more work than others, a process also works on the
/// first rows of the next one's first band, at full resolution, and hands over what it found.
struct RowShare {
  base::Range bands;
  /// Rows at the start of the next process's bands that this one works on, and rows at the start of
  /// its own bands that the process before works on. Both are pairs of slabs, and less than a band.
  std::int64_t rows_for_next = 0, rows_by_previous = 0;

  /// Returns a share of the same bands that no other process helps with.
  RowShare without_help() const { return {bands, 0, 0}; }
  bool operator==(const RowShare&) const = default;
};

/// Returns the share of a process: consecutive rows, as much work as others have, in order of
/// ranks. Throws Error if there are fewer bands (of `band_rows` rows each but for the last) than
/// processes.
RowShare row_share(std::int64_t num_rows, std::int64_t band_rows,
                   const distributed::Communicator& processes);
/// Returns the share of process `rank` of `size`.
RowShare row_share(std::int64_t num_rows, std::int64_t band_rows, int rank, int size);

/// Returns the slabs of some bands, 16 rows each, of `num_rows` rows in all.
base::Range slabs_of_bands(base::Range bands, std::int64_t band_rows, std::int64_t num_rows);

}  // namespace tomofield::measurement
