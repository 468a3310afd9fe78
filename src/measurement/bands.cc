#include "measurement/bands.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "distributed/partition.h"
#include "kernels/lanes.h"
#include "tomofield/error.h"

namespace tomofield::measurement {

using base::Range;

Range own_bands(std::int64_t num_rows, std::int64_t band_rows,
                const distributed::Communicator& processes) {
  std::vector<double> work;  // of a band: its rows
  for (std::int64_t row = 0; row < num_rows; row += band_rows)
    work.push_back(static_cast<double>(std::min(band_rows, num_rows - row)));
  if (std::ssize(work) < processes.size()) {
    throw Error(fmt::format(
        "{} processes cannot share {} rows of root cells ({} rows of pixels each): start at most "
        "{}, or give --leaf-size 16, whose root cells have 32 rows",
        processes.size(), work.size(), band_rows, work.size()));
  }
  return distributed::part_of(work, processes.rank(), processes.size());
}

Range slabs_of_bands(Range bands, std::int64_t band_rows, std::int64_t num_rows) {
  const auto slab_at = [&](int band) {
    const std::int64_t row = std::min(band * band_rows, num_rows);
    return static_cast<int>((row + kernels::kLanes - 1) / kernels::kLanes);
  };
  return {slab_at(bands.begin), slab_at(bands.end)};
}

}  // namespace tomofield::measurement
