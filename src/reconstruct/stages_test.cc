#include "reconstruct/stages.h"

#include <gtest/gtest.h>

#include <string>

namespace tomofield::reconstruct {
namespace {

int coarsest_bin(int leaf_size, const std::string& tree, int most,
                 const std::string& engine = "slab") {
  FieldOptions field;
  field.leaf_size = leaf_size;
  field.tree = tree;
  FitOptions fit;
  fit.coarse_epochs = 3;
  fit.coarse_bin = most;
  fit.engine = engine;
  return make_stages(field, fit).front().bin;
}

TEST(Stages, NoSlabOfCoarsePixelsStraddlesLeaves) {
  EXPECT_EQ(coarsest_bin(32, "uniform", 2), 2);
  EXPECT_EQ(coarsest_bin(32, "uniform", 8), 2);
  EXPECT_EQ(coarsest_bin(128, "uniform", 8), 8);
  EXPECT_EQ(coarsest_bin(128, "uniform", 7), 4);
  EXPECT_EQ(coarsest_bin(48, "uniform", 8), 1);
  EXPECT_EQ(coarsest_bin(16, "uniform", 8), 1);
  EXPECT_EQ(coarsest_bin(64, "adaptive", 8), 2);  // a leaf may become one of 32 px
  EXPECT_EQ(coarsest_bin(32, "adaptive", 8), 1);
  EXPECT_EQ(coarsest_bin(128, "uniform", 8, "ray"), 1);
}

TEST(Stages, FollowOneAnother) {
  FitOptions fit;
  fit.coarse_epochs = 3;
  fit.epochs = 7;
  const auto stages = make_stages({}, fit);
  ASSERT_EQ(stages.size(), 2u);
  EXPECT_EQ(stages[1].bin, 1);
  EXPECT_EQ(stages[0].epochs, 3);
  EXPECT_EQ(stages[1].first_epoch, 3);
  EXPECT_EQ(stages[1].epochs, 7);
  EXPECT_EQ(stages[0].first_rate, fit.learning_rate);
  EXPECT_DOUBLE_EQ(stages[1].last_rate, fit.learning_rate * fit.final_rate);
  fit.coarse_epochs = 0;
  EXPECT_EQ(make_stages({}, fit).size(), 1u);
  EXPECT_EQ(make_stages({}, fit)[0].first_rate, fit.learning_rate);
}

TEST(Stages, CoarserShapesContainEveryOtherVertex) {
  const field::LeafShape coarse =
      coarser_shape({.nx = 33, .ny = 33, .nz = 76, .rank_x = 4, .rank_y = 5, .rank_z = 6}, 2);
  EXPECT_EQ(coarse, (field::LeafShape{
                        .nx = 17, .ny = 17, .nz = 39, .rank_x = 4, .rank_y = 5, .rank_z = 6}));
  EXPECT_EQ(coarser_shape({.nx = 2, .ny = 3, .nz = 2}, 8).nx, 2);
}

}  // namespace
}  // namespace tomofield::reconstruct
