#include "measurement/row_share.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "base/range.h"
#include "kernels/lanes.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

using base::Range;
using kernels::kLanes;

constexpr std::int64_t kPairRows = 2 * kLanes;  // slabs are worked on in pairs

// The part of a step's work that is done slab by slab. The rest is done leaf by leaf, by the
// process that owns the leaf.
constexpr double kSlabWork = 0.8;
// The work of the process with the most must become less by so much to be worth the messages.
constexpr double kWorthwhile = 0.95;

std::vector<RowShare> shares_of_whole_bands(const std::vector<double>& rows_of_band, int size) {
  std::vector<RowShare> shares;
  for (int rank = 0; rank < size; ++rank)
    shares.push_back({base::part_of(rows_of_band, rank, size)});
  return shares;
}

// Cuts the rows into parts of as many pairs of slabs as possible. The band in which a cut lies
// belongs to the process after the cut, and the process before it works on the rows up to the cut.
// Returns nothing if a process would own no band.
std::vector<RowShare> shares_of_pairs(std::int64_t num_rows, std::int64_t band_rows, int size) {
  const std::int64_t num_pairs = (num_rows + kPairRows - 1) / kPairRows;
  const auto num_bands = static_cast<int>((num_rows + band_rows - 1) / band_rows);
  const auto cut_of = [&](int rank) {  // in rows
    return rank == size ? num_rows : (2 * num_pairs * rank / size + 1) / 2 * kPairRows;
  };
  const auto band_of = [&](int rank) {
    return rank == size ? num_bands : static_cast<int>(cut_of(rank) / band_rows);
  };
  const auto rows_before_cut = [&](int rank) {
    return rank == size ? 0 : cut_of(rank) - band_of(rank) * band_rows;
  };
  std::vector<RowShare> shares;
  for (int rank = 0; rank < size; ++rank) {
    shares.push_back(
        {{band_of(rank), band_of(rank + 1)}, rows_before_cut(rank + 1), rows_before_cut(rank)});
    if (shares.back().bands.is_empty()) return {};
  }
  return shares;
}

// Returns the work of the process that has the most, in rows.
double most_work(const std::vector<RowShare>& shares, const std::vector<double>& rows_of_band) {
  double most = 0.0;
  for (const RowShare& share : shares) {
    double own = 0.0;
    for (int band = share.bands.begin; band < share.bands.end; ++band)
      own += rows_of_band[static_cast<std::size_t>(band)];
    most = std::max(
        most, own + kSlabWork * static_cast<double>(share.rows_for_next - share.rows_by_previous));
  }
  return most;
}

}  // namespace

RowShare row_share(std::int64_t num_rows, std::int64_t band_rows, int rank, int size) {
  std::vector<double> rows_of_band;
  for (std::int64_t row = 0; row < num_rows; row += band_rows)
    rows_of_band.push_back(static_cast<double>(std::min(band_rows, num_rows - row)));
  const std::ptrdiff_t num_bands = std::ssize(rows_of_band);
  if (num_bands < size) {
    throw Error(fmt::format(
        "{} processes cannot share {} rows of root cells ({} rows of pixels each): start at most "
        "{}, or give --leaf-size 16, whose root cells have 32 rows",
        size, num_bands, band_rows, num_bands));
  }
  std::vector<RowShare> shares = shares_of_whole_bands(rows_of_band, size);
  if (band_rows % kPairRows == 0) {
    const std::vector<RowShare> cut = shares_of_pairs(num_rows, band_rows, size);
    if (!cut.empty() &&
        most_work(cut, rows_of_band) < kWorthwhile * most_work(shares, rows_of_band))
      shares = cut;
  }
  return shares[static_cast<std::size_t>(rank)];
}

RowShare row_share(std::int64_t num_rows, std::int64_t band_rows,
                   const distributed::Communicator& processes) {
  return row_share(num_rows, band_rows, processes.rank(), processes.size());
}

Range slabs_of_bands(Range bands, std::int64_t band_rows, std::int64_t num_rows) {
  const auto slab_at = [&](int band) {
    const std::int64_t row = std::min(band * band_rows, num_rows);
    return static_cast<int>((row + kLanes - 1) / kLanes);
  };
  return {slab_at(bands.begin), slab_at(bands.end)};
}

}  // namespace tomofield::measurement
