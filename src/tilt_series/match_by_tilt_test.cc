#include "tilt_series/match_by_tilt.h"

#include <gtest/gtest.h>

namespace tomofield::tilt_series {
namespace {

using Tilts = std::vector<std::optional<double>>;
using Rows = std::vector<std::optional<std::size_t>>;

TEST(MatchByTilt, FindsTheRowsOfSectionsThatAreLeft) {
  const Tilts rows{-6, -3, 0, 3, 6};
  EXPECT_EQ(match_by_tilt(Tilts{-3.2, 0.4, 6.0}, rows), (Rows{1, 2, 4}));
  EXPECT_EQ(match_by_tilt(Tilts{6.0, std::nullopt, -6.0}, rows), (Rows{4, std::nullopt, 0}));
  EXPECT_EQ(match_by_tilt(Tilts{0.0}, Tilts{std::nullopt, 0.0}), (Rows{1}));
}

TEST(MatchByTilt, RefusesWhatIsAmbiguous) {
  EXPECT_FALSE(match_by_tilt(Tilts{1.5}, Tilts{0, 3}));             // between two rows
  EXPECT_FALSE(match_by_tilt(Tilts{9.0}, Tilts{0, 3, 6}));          // no row at all
  EXPECT_FALSE(match_by_tilt(Tilts{0.0, 3.0}, Tilts{0, 3, 3.01}));  // recorded twice, one is left
  EXPECT_FALSE(match_by_tilt(Tilts{0.0, 0.1}, Tilts{0, 3}));        // two sections of one row
  EXPECT_FALSE(match_by_tilt(Tilts{0.2}, Tilts{0, 0, 3}));          // two rows with one tilt
}

}  // namespace
}  // namespace tomofield::tilt_series
