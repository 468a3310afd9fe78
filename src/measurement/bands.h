#pragma once

#include <cstdint>

#include "base/range.h"
#include "distributed/communicator.h"

namespace tomofield::measurement {

/// Which bands (rows of root cells, `band_rows` rows each but for the last) a process works
/// on: consecutive ones, as many rows as others have, in order of ranks. Throws Error if there
/// are fewer bands than processes.
base::Range own_bands(std::int64_t num_rows, std::int64_t band_rows,
                      const distributed::Communicator& processes);

/// The slabs of those bands, of `num_rows` rows in all, 16 each.
base::Range slabs_of_bands(base::Range bands, std::int64_t band_rows, std::int64_t num_rows);

}  // namespace tomofield::measurement
