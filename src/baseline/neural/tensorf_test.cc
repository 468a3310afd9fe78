#include "baseline/neural/tensorf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "fit/domain.h"
#include "fit/stages.h"
#include "option_table/values.h"
#include "tomofield/error.h"

namespace tomofield::baseline {
namespace {

int node_size(std::int64_t width, std::int64_t height) {
  return one_node_size({5, 7, 5 + width, 7 + height}, tensorf_defaults().fit.coarse_bin);
}

FieldOptions field_for(std::int64_t width, std::int64_t height) {
  FieldOptions field;
  field.rank = tensorf_defaults().field.rank;
  field.with_margin = false;
  field.leaf_size = node_size(width, height);
  return field;
}

TEST(Tensorf, OneNodeCoversTheRegion) {
  for (const std::int64_t width : {20, 100, 128, 500}) {
    const FieldOptions field = field_for(width, 90);
    const Rectangle roi{5, 7, 5 + width, 97};
    const auto domain =
        fit::make_domain(geometry::centred_geometry(600, 600, 40, {-60, 0, 60}), roi, field);
    ASSERT_EQ(domain.tree.num_leaves(), 1);
    EXPECT_GE(domain.tree.leaf(0).square.size, std::max<std::int64_t>(width, 90));
    EXPECT_LT(domain.tree.leaf(0).square.size, std::max<std::int64_t>(width, 90) + 128);
    Options options = tensorf_defaults();
    options.specimen.thickness = 40;
    options.field.leaf_size = field.leaf_size;
    EXPECT_EQ(option_table::range_faults(options), std::vector<std::string>());
  }
}

TEST(Tensorf, StartsWithVerticesEightTimesAsFarApart) {
  const Options defaults = tensorf_defaults();
  FitOptions fit;
  fit.epochs = *defaults.fit.epochs;
  fit.vertex_epochs = *defaults.fit.vertex_epochs;
  fit.coarse_epochs = *defaults.fit.coarse_epochs;
  fit.coarse_bin = defaults.fit.coarse_bin;
  const auto stages = fit::make_stages(field_for(128, 128), fit);
  ASSERT_EQ(stages.size(), 4u);
  EXPECT_EQ(stages.front().bin, 8);
  EXPECT_EQ(node_size(40, 40), 64);  // a multiple of slabs of pixels binned by 2
}

TEST(Tensorf, RegionsAreNotLargerThanANode) {
  EXPECT_EQ(node_size(4096, 10), 4096);
  EXPECT_THROW(node_size(4097, 10), Error);
}

}  // namespace
}  // namespace tomofield::baseline
