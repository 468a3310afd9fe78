#include "base/range.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "base/random.h"

namespace tomofield::base {
namespace {

using base::Range;

TEST(Partition, EqualPiecesMakeEqualParts) {
  const std::vector<double> work(12, 64.0);
  EXPECT_EQ(part_of(work, 0, 3), (Range{0, 4}));
  EXPECT_EQ(part_of(work, 1, 3), (Range{4, 8}));
  EXPECT_EQ(part_of(work, 2, 3), (Range{8, 12}));
  EXPECT_EQ(part_of(work, 0, 1), (Range{0, 12}));
}

// Checks that every piece has one owner, that no part is empty, and that none exceeds its share by
// more than one piece.
TEST(Partition, PartsCoverTheWorkAndAreBalanced) {
  base::Random random(4);
  for (int trial = 0; trial < 500; ++trial) {
    std::vector<double> work(4 + random.below(40));
    for (double& w : work) w = random.uniform(0.5, 1.5);
    const double all = std::accumulate(work.begin(), work.end(), 0.0);
    const double largest = *std::max_element(work.begin(), work.end());
    const int count = 1 + static_cast<int>(random.below(work.size() / 4));
    int next = 0;
    for (int part = 0; part < count; ++part) {
      const Range range = part_of(work, part, count);
      ASSERT_EQ(range.begin, next);
      ASSERT_GT(range.size(), 0);
      next = range.end;
      const double own = std::accumulate(work.begin() + range.begin, work.begin() + range.end, 0.0);
      EXPECT_LE(own, all / count + largest * (1 + 1e-12)) << part << " of " << count;
    }
    ASSERT_EQ(next, static_cast<int>(work.size()));
  }
}

TEST(Partition, APieceForEachPartEvenIfOneHasAllTheWork) {
  const std::vector<double> work{0.0, 0.0, 100.0, 0.0};
  for (int part = 0; part < 4; ++part) EXPECT_EQ(part_of(work, part, 4), (Range{part, part + 1}));
}

}  // namespace
}  // namespace tomofield::base
