#include "plan/tile_plan.h"

#include <gtest/gtest.h>

namespace tomofield::plan {
namespace {

TEST(TilePlan, TilesCoverTheRegionWithRowsBesideThem) {
  const TilePlan plan{.num_whole_stages = 1, .rows = 128, .overlap = 64, .num_rows = 300};
  const std::vector<Tile> tiles = plan.tiles_from(0);
  ASSERT_EQ(tiles.size(), 3u);
  EXPECT_EQ(tiles[0].own, (base::Range{0, 128}));
  EXPECT_EQ(tiles[0].fitted, (base::Range{0, 192}));
  EXPECT_EQ(tiles[1].fitted, (base::Range{64, 300}));
  EXPECT_EQ(tiles[2].own, (base::Range{256, 300}));
  EXPECT_EQ(tiles[2].fitted, (base::Range{192, 300}));
  EXPECT_EQ(plan.tiles_from(128).size(), 2u);
  EXPECT_DOUBLE_EQ(plan.repeats(), (192 + 236 + 108) / 300.0);
  EXPECT_FALSE(TilePlan{}.is_used());
}

}  // namespace
}  // namespace tomofield::plan
