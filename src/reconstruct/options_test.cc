#include "reconstruct/options.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "base/check.h"
#include "fit/integer_program.h"
#include "fit/options.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

ReconstructOptions good_options() {
  ReconstructOptions options;
  options.specimen.thickness = 100;
  return options;
}

TEST(ReconstructOptions, DefaultsAreSound) { EXPECT_TRUE(good_options().faults().empty()); }

TEST(ReconstructOptions, NoNumberMayBeNaN) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (double fit::FieldOptions::*number :
       {&fit::FieldOptions::vertex_spacing, &fit::FieldOptions::margin_spacing,
        &fit::FieldOptions::sharpness, &fit::FieldOptions::initial_scale}) {
    fit::FieldOptions options;
    options.*number = nan;
    EXPECT_EQ(options.faults().size(), 1u);
  }
  for (double fit::FitOptions::*number : std::initializer_list<double fit::FitOptions::*>{
           &fit::FitOptions::learning_rate, &fit::FitOptions::final_rate,
           &fit::FitOptions::density_variation, &fit::FitOptions::factor_variation,
           &fit::FitOptions::boundary, &fit::FitOptions::fourier, &fit::FitOptions::concavity,
           &fit::FitOptions::gradient_floor}) {
    fit::FitOptions options;
    options.*number = nan;
    EXPECT_EQ(options.faults().size(), 1u);
  }
}

TEST(ReconstructOptions, EveryFaultIsNamedAtOnce) {
  ReconstructOptions options = good_options();
  options.specimen.thickness = 0;
  options.field.leaf_size = 24;
  options.field.rank = 0;
  options.fit.subsets = 0;
  options.checkpoint_minutes = -1;
  EXPECT_EQ(options.faults().size(), 5u);
  const std::string message =
      testing::message_of<Error>([&] { base::require_no_faults(options.faults()); });
  for (const char* word :
       {"--thickness", "--leaf-size", "24", "--rank", "--subsets", "--checkpoint-minutes"})
    EXPECT_NE(message.find(word), std::string::npos) << word << " in " << message;
}

TEST(ReconstructOptions, LargeLeavesOfAUniformTreeAreRootCells) {
  fit::FieldOptions field;
  EXPECT_EQ(fit::usual_leaf_size(field), field.leaf_size);
  EXPECT_EQ(fit::usual_depth(field), field.depth);
  field.kind = FieldKind::kGrid;
  field.leaf_size = fit::usual_leaf_size(field);
  EXPECT_GT(field.leaf_size, fit::FieldOptions{}.leaf_size);
  EXPECT_EQ(fit::usual_depth(field), 0);
  field.tree = TreeKind::kAdaptive;  // whose leaves may become twice as wide
  EXPECT_EQ(fit::usual_leaf_size(field), fit::FieldOptions{}.leaf_size);
  EXPECT_EQ(fit::usual_depth(field), 1);
}

TEST(ReconstructOptions, OnlyFactorsOfAUniformTreeBeginAsVertices) {
  if (!fit::can_solve_integer_programs()) GTEST_SKIP() << "this build is without COIN-OR CBC";
  const auto num_faults = [](FieldKind kind, TreeKind tree, Engine engine) {
    ReconstructOptions options = good_options();
    options.fit.vertex_epochs = 3;
    options.field.kind = kind;
    options.field.tree = tree;
    options.fit.engine = engine;
    return options.faults().size();
  };
  EXPECT_EQ(num_faults(FieldKind::kVm, TreeKind::kUniform, Engine::kSlab), 0u);
  EXPECT_EQ(num_faults(FieldKind::kGrid, TreeKind::kUniform, Engine::kSlab), 1u);
  EXPECT_EQ(num_faults(FieldKind::kVm, TreeKind::kAdaptive, Engine::kSlab), 1u);
  EXPECT_EQ(num_faults(FieldKind::kVm, TreeKind::kUniform, Engine::kRay), 1u);
}

TEST(ReconstructOptions, ABudgetIsForAdaptiveTrees) {
  if (!fit::can_solve_integer_programs()) GTEST_SKIP() << "this build is without COIN-OR CBC";
  fit::FieldOptions options;
  options.leaf_budget = 12;
  EXPECT_EQ(options.faults().size(), 1u);
  options.tree = TreeKind::kAdaptive;
  EXPECT_TRUE(options.faults().empty());
  options.leaf_budget = -1;
  EXPECT_EQ(options.faults().size(), 1u);
}

}  // namespace
}  // namespace tomofield::reconstruction
