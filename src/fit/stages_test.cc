#include "fit/stages.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/enum_names.h"
#include "fit/constants.h"

namespace tomofield::fit {
namespace {

int coarsest_bin(int leaf_size, TreeKind tree, int most, Engine engine = Engine::kSlab) {
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
  EXPECT_EQ(coarsest_bin(32, TreeKind::kUniform, 2), 2);
  EXPECT_EQ(coarsest_bin(32, TreeKind::kUniform, 8), 2);
  EXPECT_EQ(coarsest_bin(128, TreeKind::kUniform, 8), 8);
  EXPECT_EQ(coarsest_bin(128, TreeKind::kUniform, 7), 4);
  EXPECT_EQ(coarsest_bin(48, TreeKind::kUniform, 8), 1);
  EXPECT_EQ(coarsest_bin(16, TreeKind::kUniform, 8), 1);
  EXPECT_EQ(coarsest_bin(64, TreeKind::kAdaptive, 8), 2);  // a leaf may become one of 32 px
  EXPECT_EQ(coarsest_bin(256, TreeKind::kAdaptive, 8), 2);
  EXPECT_EQ(coarsest_bin(32, TreeKind::kAdaptive, 8), 1);
  EXPECT_EQ(coarsest_bin(128, TreeKind::kUniform, 8, Engine::kRay), 1);
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
  EXPECT_DOUBLE_EQ(stages[1].last_rate, fit.learning_rate * kFinalRate);
  fit.coarse_epochs = 0;
  EXPECT_EQ(make_stages({}, fit).size(), 1u);
  EXPECT_EQ(make_stages({}, fit)[0].first_rate, fit.learning_rate);
}

// Returns the stages of leaves that are large enough for three coarse stages.
std::vector<Stage> stages_of_large_leaves(int coarse_epochs, int coarse_bin) {
  FieldOptions field;
  field.leaf_size = 128;
  FitOptions fit;
  fit.coarse_epochs = coarse_epochs;
  fit.coarse_bin = coarse_bin;
  fit.epochs = 5;
  return make_stages(field, fit);
}

TEST(Stages, SeveralCoarseOnesShareTheirEpochs) {
  const auto stages = stages_of_large_leaves(8, 8);
  ASSERT_EQ(stages.size(), 4u);
  std::int64_t first_epoch = 0;
  for (std::size_t s = 0; s < 4; ++s) {
    EXPECT_EQ(stages[s].bin, 8 >> s);
    EXPECT_EQ(stages[s].first_epoch, first_epoch);
    EXPECT_EQ(stages[s].epochs, s == 0 ? 2 : s == 3 ? 5 : 3);
    EXPECT_LT(stages[s].last_rate, stages[s].first_rate);
    first_epoch += stages[s].epochs;
  }
  EXPECT_EQ(stages_of_large_leaves(8, 2).size(), 2u);
}

TEST(Stages, NoneIsWithoutEpochs) {
  const auto stages = stages_of_large_leaves(1, 8);
  ASSERT_EQ(stages.size(), 2u);
  EXPECT_EQ(stages[0].bin, 2);
  EXPECT_EQ(stages[0].epochs, 1);
}

FieldOptions factors(int leaf_size, int rank, double spacing = 1.0) {
  FieldOptions field;
  field.leaf_size = leaf_size;
  field.rank = rank;
  field.vertex_spacing = spacing;
  return field;
}

TEST(Stages, FactorsMayBeginAsPlainVertices) {
  FitOptions fit;
  fit.coarse_epochs = 6;
  fit.vertex_epochs = 4;
  fit.epochs = 3;
  const auto stages = make_stages(factors(64, 40), fit);
  ASSERT_EQ(stages.size(), 4u);
  const std::vector<FieldKind> kinds{FieldKind::kGrid, FieldKind::kGrid, FieldKind::kGrid,
                                     FieldKind::kVm};
  const std::vector<int> bins{4, 2, 1, 1}, epochs{3, 3, 4, 3};
  std::int64_t first_epoch = 0;
  for (std::size_t s = 0; s < 4; ++s) {
    EXPECT_EQ(stages[s].field_kind, kinds[s]);
    EXPECT_EQ(stages[s].bin, bins[s]);
    EXPECT_EQ(stages[s].epochs, epochs[s]);
    EXPECT_EQ(stages[s].first_epoch, first_epoch);
    EXPECT_LT(stages[s].last_rate, stages[s].first_rate);
    first_epoch += epochs[s];
  }
  // Vertices have smaller rates than factors, and the factors made of them begin with small rates.
  EXPECT_DOUBLE_EQ(stages[0].first_rate, 0.7 * fit.learning_rate);
  EXPECT_DOUBLE_EQ(stages[2].first_rate, 0.35 * fit.learning_rate);
  EXPECT_DOUBLE_EQ(stages[3].first_rate, 0.3 * fit.learning_rate);
  EXPECT_DOUBLE_EQ(stages[3].last_rate, 0.1 * fit.learning_rate);
  // A step of vertices costs less than one of factors, and a coarse one an eighth of it.
  EXPECT_LT(stages[2].step_cost, stages[3].step_cost);
  EXPECT_DOUBLE_EQ(8 * stages[1].step_cost, stages[2].step_cost);
  fit.vertex_epochs = 0;
  for (const Stage& stage : make_stages(factors(64, 40), fit))
    EXPECT_EQ(stage.field_kind, FieldKind::kVm);
}

TEST(Stages, CoarseStagesOfAnAdaptiveTreeCostAnEighth) {
  FieldOptions field = factors(64, 40);
  field.tree = TreeKind::kAdaptive;
  FitOptions fit;
  fit.coarse_epochs = 6;
  const std::vector<Stage> stages = make_stages(field, fit);
  ASSERT_EQ(stages.size(), 2u);
  EXPECT_DOUBLE_EQ(stages[0].step_cost, 0.125);
  EXPECT_DOUBLE_EQ(stages[1].step_cost, 1.0);
}

TEST(Stages, FarVerticesMakeCoarseStagesDearer) {
  FieldOptions field;
  field.kind = FieldKind::kGrid;
  field.vertex_spacing = 3.0;
  field.leaf_size = 64;
  FitOptions fit;
  fit.coarse_epochs = 6;
  const std::vector<Stage> stages = make_stages(field, fit);
  ASSERT_EQ(stages.size(), 3u);
  // Pixels of 2 × 2 have as many vertices as those of full resolution, and pixels of 4 × 4 have
  // (3 / 4)³ of them.
  // The measured costs are 0.17 and 0.054 (docs/results/speed.md).
  EXPECT_NEAR(stages[1].step_cost, 0.17, 0.02);
  EXPECT_NEAR(stages[0].step_cost, 0.054, 0.015);
}

TEST(Stages, FactorsBeginAsVerticesWhereTheseAreNoMore) {
  const FitOptions slabs;
  EXPECT_TRUE(begins_with_vertices(factors(32, 24), slabs));
  EXPECT_TRUE(begins_with_vertices(factors(32, 16), slabs));
  FieldOptions wide = factors(64, 16, 2);
  EXPECT_TRUE(begins_with_vertices(wide, slabs));
  EXPECT_FALSE(begins_with_vertices(factors(32, 15), slabs));
  EXPECT_FALSE(begins_with_vertices(factors(256, 16, 2.5), slabs));
  EXPECT_TRUE(begins_with_vertices(factors(32, 27), slabs));
  EXPECT_FALSE(begins_with_vertices(factors(32, 28), slabs));  // 5 x 5 are left for 28 along z
  EXPECT_FALSE(begins_with_vertices(factors(32, 33), slabs));
  EXPECT_FALSE(begins_with_vertices(factors(32, 40), slabs));
  FieldOptions dense_margin = factors(32, 24);
  dense_margin.margin_spacing = 1;
  EXPECT_FALSE(begins_with_vertices(dense_margin, slabs));
  dense_margin.with_margin = false;
  EXPECT_TRUE(begins_with_vertices(dense_margin, slabs));
  FieldOptions other = factors(32, 24);
  other.tree = TreeKind::kAdaptive;
  EXPECT_FALSE(begins_with_vertices(other, slabs));
  other = factors(32, 24);
  other.kind = FieldKind::kGrid;
  EXPECT_FALSE(begins_with_vertices(other, slabs));
  FitOptions rays;
  rays.engine = Engine::kRay;
  EXPECT_FALSE(begins_with_vertices(factors(32, 24), rays));
}

TEST(Stages, FactorsThatBeginAsVerticesTakeAThirdOfTheEpochs) {
  FitOptions fit;
  const Schedule alone = usual_schedule(factors(32, 24), fit);
  fit.vertex_epochs = 1;
  const Schedule usual = usual_schedule(factors(32, 24), fit);
  EXPECT_EQ(3 * usual.epochs, alone.epochs);
  EXPECT_EQ(usual.learning_rate, alone.learning_rate);
  EXPECT_EQ(usual.vertex_epochs_of(usual.epochs), usual.epochs);
  EXPECT_EQ(usual.vertex_epochs_of(3), 3);
  EXPECT_EQ(usual.vertex_epochs_of(50), usual.epochs);
}

TEST(Stages, FilteredViewsTakeTwiceTheEpochsOfPlainVertices) {
  FieldOptions vertices;
  vertices.kind = FieldKind::kGrid;
  const FitOptions fit;
  EXPECT_EQ(usual_schedule(vertices, fit, true).epochs, 2 * usual_schedule(vertices, fit).epochs);
  EXPECT_EQ(usual_schedule(factors(32, 24), fit, true).epochs,
            usual_schedule(factors(32, 24), fit).epochs);
}

Schedule usual(FieldKind kind, double spacing, int coarse_epochs = 1,
               TreeKind tree = TreeKind::kUniform) {
  FieldOptions field;
  field.leaf_size = 128;
  field.kind = kind;
  field.tree = tree;
  field.vertex_spacing = spacing;
  FitOptions fit;
  fit.coarse_epochs = coarse_epochs;
  return usual_schedule(field, fit);
}

TEST(Stages, FullResolutionIsShortIfTheCoarseOneHasAllVertices) {
  for (const FieldKind kind : {FieldKind::kVm, FieldKind::kGrid}) {
    EXPECT_EQ(usual(kind, 1.9).epochs, usual(kind, 1.0).epochs) << base::name_of(kind);
    EXPECT_LT(usual(kind, 2.0).epochs, usual(kind, 1.0).epochs) << base::name_of(kind);
    EXPECT_EQ(usual(kind, 2.0, 0).epochs, usual(kind, 1.0).epochs)
        << base::name_of(kind) << ", no coarse stage";
  }
  EXPECT_EQ(usual(FieldKind::kVm, 2.0, 1, TreeKind::kAdaptive).epochs,
            usual(FieldKind::kVm, 1.0).epochs);
  EXPECT_LT(usual(FieldKind::kVm, 4.0, 1, TreeKind::kAdaptive).epochs,
            usual(FieldKind::kVm, 1.0).epochs);
  EXPECT_LT(usual(FieldKind::kGrid, 1.0).epochs, usual(FieldKind::kVm, 1.0).epochs);
  EXPECT_EQ(usual(FieldKind::kVm, 1.0).coarse_epochs_of(30), 160);
  EXPECT_EQ(usual(FieldKind::kVm, 1.0).coarse_epochs_of(15), 80);
  EXPECT_EQ(usual(FieldKind::kVm, 2.0).coarse_epochs_of(5), 160);
  EXPECT_EQ(usual(FieldKind::kVm, 2.0).coarse_epochs_of(30), 160);
}

}  // namespace
}  // namespace tomofield::fit
