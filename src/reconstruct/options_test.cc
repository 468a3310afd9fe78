#include "reconstruct/options.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "reconstruct/run_options.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::reconstruct {
namespace {

ReconstructOptions good_options() {
  ReconstructOptions options;
  options.specimen.thickness = 100;
  return options;
}

TEST(ReconstructOptions, DefaultsAreSound) { EXPECT_TRUE(good_options().faults().empty()); }

TEST(ReconstructOptions, NoNumberMayBeNaN) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (double FieldOptions::*number : {&FieldOptions::vertex_spacing, &FieldOptions::margin_spacing,
                                       &FieldOptions::sharpness, &FieldOptions::initial_scale}) {
    FieldOptions options;
    options.*number = nan;
    EXPECT_EQ(options.faults().size(), 1u);
  }
  for (double FitOptions::*number :
       {&FitOptions::learning_rate, &FitOptions::final_rate, &FitOptions::density_variation,
        &FitOptions::factor_variation, &FitOptions::boundary, &FitOptions::fourier,
        &FitOptions::concavity, &FitOptions::gradient_floor}) {
    FitOptions options;
    options.*number = nan;
    EXPECT_EQ(options.faults().size(), 1u);
  }
}

TEST(ReconstructOptions, EveryFaultIsNamedAtOnce) {
  ReconstructOptions options = good_options();
  options.specimen.thickness = 0;
  options.field.leaf_size = 24;
  options.field.kind = "mesh";
  options.fit.subsets = 0;
  options.checkpoint_minutes = -1;
  EXPECT_EQ(options.faults().size(), 5u);
  const std::string message =
      testing::message_of<Error>([&] { require_no_faults(options.faults()); });
  for (const char* word :
       {"--thickness", "--leaf-size", "24", "mesh", "--subsets", "--checkpoint-minutes"})
    EXPECT_NE(message.find(word), std::string::npos) << word << " in " << message;
}

TEST(ReconstructOptions, LargeLeavesOfAUniformTreeAreRootCells) {
  FieldOptions field;
  EXPECT_EQ(usual_leaf_size(field), field.leaf_size);
  EXPECT_EQ(usual_depth(field), field.depth);
  field.kind = "grid";
  field.leaf_size = usual_leaf_size(field);
  EXPECT_GT(field.leaf_size, FieldOptions{}.leaf_size);
  EXPECT_EQ(usual_depth(field), 0);
  field.tree = "adaptive";  // whose leaves may become twice as wide
  EXPECT_EQ(usual_leaf_size(field), FieldOptions{}.leaf_size);
  EXPECT_EQ(usual_depth(field), 1);
}

TEST(ReconstructOptions, OnlyFactorsOfAUniformTreeBeginAsVertices) {
  const auto num_faults = [](const std::string& kind, const std::string& tree,
                             const std::string& engine) {
    ReconstructOptions options = good_options();
    options.fit.vertex_epochs = 3;
    options.field.kind = kind;
    options.field.tree = tree;
    options.fit.engine = engine;
    return options.faults().size();
  };
  EXPECT_EQ(num_faults("vm", "uniform", "slab"), 0u);
  EXPECT_EQ(num_faults("grid", "uniform", "slab"), 1u);
  EXPECT_EQ(num_faults("vm", "adaptive", "slab"), 1u);
  EXPECT_EQ(num_faults("vm", "uniform", "ray"), 1u);
}

TEST(ReconstructOptions, ABudgetIsForAdaptiveTrees) {
  FieldOptions options;
  options.leaf_budget = 12;
  EXPECT_EQ(options.faults().size(), 1u);
  options.tree = "adaptive";
  EXPECT_TRUE(options.faults().empty());
  options.leaf_budget = -1;
  EXPECT_EQ(options.faults().size(), 1u);
  options.tree = "binary";
  EXPECT_EQ(options.faults().size(), 2u);
}

}  // namespace
}  // namespace tomofield::reconstruct
