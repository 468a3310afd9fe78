#include "measurement/row_share.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

using base::Range;

TEST(RowShare, AProcessAloneHasAllRows) {
  EXPECT_EQ(row_share(200, 64, 0, 1), (RowShare{{0, 4}, 0, 0}));
  EXPECT_EQ(row_share(64, 64, 0, 1), (RowShare{{0, 1}, 0, 0}));
  EXPECT_EQ(slabs_of_bands({0, 4}, 64, 200), (Range{0, 13}));
  EXPECT_EQ(slabs_of_bands({1, 3}, 64, 200), (Range{4, 12}));
  EXPECT_EQ(slabs_of_bands({3, 4}, 64, 200), (Range{12, 13}));
}

// Every row is worked on once, every band has one owner, and neighbours agree.
TEST(RowShare, SharesCoverTheRows) {
  for (const std::int64_t band_rows : {32, 64, 96, 160}) {
    for (std::int64_t num_rows = 200; num_rows < 1500; num_rows += 88) {
      const auto num_bands = static_cast<int>((num_rows + band_rows - 1) / band_rows);
      for (int size = 1; size <= std::min(num_bands, 12); ++size) {
        SCOPED_TRACE(::testing::Message()
                     << num_rows << " rows, bands of " << band_rows << ", " << size);
        std::vector<RowShare> shares;
        for (int rank = 0; rank < size; ++rank)
          shares.push_back(row_share(num_rows, band_rows, rank, size));
        EXPECT_EQ(shares.front().bands.begin, 0);
        EXPECT_EQ(shares.back().bands.end, num_bands);
        EXPECT_EQ(shares.front().rows_by_previous, 0);
        EXPECT_EQ(shares.back().rows_for_next, 0);
        for (int rank = 0; rank < size; ++rank) {
          const RowShare& share = shares[static_cast<std::size_t>(rank)];
          EXPECT_FALSE(share.bands.is_empty());
          EXPECT_LT(share.rows_for_next, band_rows);
          EXPECT_EQ(share.rows_for_next % 32, 0);
          if (rank == 0) continue;
          EXPECT_EQ(share.bands.begin, shares[static_cast<std::size_t>(rank) - 1].bands.end);
          EXPECT_EQ(share.rows_by_previous,
                    shares[static_cast<std::size_t>(rank) - 1].rows_for_next);
        }
      }
    }
  }
}

TEST(RowShare, ABandIsDividedOnlyWhereThatBalancesBetter) {
  // Four bands for two processes, or for four, need no help.
  for (int rank = 0; rank < 2; ++rank)
    EXPECT_EQ(row_share(256, 64, rank, 2), (RowShare{{2 * rank, 2 * rank + 2}, 0, 0}));
  // Four bands are eight pairs of slabs: three processes work on 3, 2 and 3 of them.
  EXPECT_EQ(row_share(256, 64, 0, 3), (RowShare{{0, 1}, 32, 0}));
  EXPECT_EQ(row_share(256, 64, 1, 3), (RowShare{{1, 2}, 32, 32}));
  EXPECT_EQ(row_share(256, 64, 2, 3), (RowShare{{2, 4}, 0, 32}));
  // A band of one pair cannot be divided.
  for (int rank = 0; rank < 3; ++rank) EXPECT_EQ(row_share(128, 32, rank, 3).rows_for_next, 0);
}

TEST(RowShare, MoreProcessesThanBandsAreRefused) { EXPECT_THROW(row_share(128, 64, 0, 3), Error); }

}  // namespace
}  // namespace tomofield::measurement
