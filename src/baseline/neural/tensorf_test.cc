#include "baseline/neural/tensorf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "fit/domain.h"
#include "fit/stages.h"
#include "tomofield/error.h"

namespace tomofield::baseline {
namespace {

reconstruction::ReconstructOptions options_for(std::int64_t width, std::int64_t height) {
  reconstruction::ReconstructOptions options = tensorf_options();
  options.field.with_margin = false;
  cover_with_one_node({5, 7, 5 + width, 7 + height}, options);
  return options;
}

TEST(Tensorf, OneNodeCoversTheRegion) {
  for (const std::int64_t width : {20, 100, 128, 500}) {
    const reconstruction::ReconstructOptions options = options_for(width, 90);
    const Rectangle roi{5, 7, 5 + width, 97};
    const auto domain = fit::make_domain(geometry::centred_geometry(600, 600, 40, {-60, 0, 60}),
                                         roi, options.field);
    ASSERT_EQ(domain.tree.num_leaves(), 1);
    EXPECT_GE(domain.tree.leaf(0).square.size, std::max<std::int64_t>(width, 90));
    EXPECT_LT(domain.tree.leaf(0).square.size, std::max<std::int64_t>(width, 90) + 128);
    EXPECT_EQ(options.field.faults(), std::vector<std::string>());
  }
}

TEST(Tensorf, StartsWithVerticesEightTimesAsFarApart) {
  const reconstruction::ReconstructOptions options = options_for(128, 128);
  const auto stages = fit::make_stages(options.field, options.fit);
  ASSERT_EQ(stages.size(), 4u);
  EXPECT_EQ(stages.front().bin, 8);
  EXPECT_EQ(options_for(40, 40).field.leaf_size, 64);  // a multiple of slabs of pixels binned by 2
}

TEST(Tensorf, RegionsAreNotLargerThanANode) {
  EXPECT_EQ(options_for(4096, 10).field.leaf_size, 4096);
  EXPECT_THROW(options_for(4097, 10), Error);
}

}  // namespace
}  // namespace tomofield::baseline
