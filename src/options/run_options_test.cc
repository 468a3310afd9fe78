#include "options/run_options.h"

#include <gtest/gtest.h>

#include <string>

#include "base/check.h"
#include "fit/integer_program.h"
#include "fit/options.h"
#include "kernels/lanes.h"
#include "option_table/values.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::options {
namespace {

Options good_options() {
  Options options;
  options.thickness = 100;
  return options;
}

std::vector<std::string> faults_of(const Options& options) {
  return run_options({}, options).faults();
}

std::string json_text(const Options& options) { return option_table::to_json({}, options).dump(); }

TEST(ReconstructOptions, DefaultsAreSound) { EXPECT_TRUE(faults_of(good_options()).empty()); }

TEST(ReconstructOptions, EveryFaultIsNamedAtOnce) {
  Options options = good_options();
  options.thickness = 0;
  options.leaf_size = 24;
  options.rank = 0;
  options.subsets = 0;
  options.checkpoint_minutes = -1;
  EXPECT_EQ(faults_of(options).size(), 5u);
  const std::string message =
      testing::message_of<Error>([&] { base::require_no_faults(faults_of(options)); });
  for (const char* word :
       {"--thickness", "--leaf-size", "24", "--rank", "--subsets", "--checkpoint-minutes"})
    EXPECT_NE(message.find(word), std::string::npos) << word << " in " << message;
}

TEST(ReconstructOptions, WhatFiltersViewsNeedsTheSlabEngine) {
  Options options = good_options();
  options.engine = Engine::kRay;
  const std::size_t alone = faults_of(options).size();
  SeriesFiles files;
  files.mtf = "detector.star";
  const ReconstructOptions with_mtf = run_options(files, options);
  EXPECT_TRUE(with_mtf.filters_views());
  EXPECT_EQ(with_mtf.faults().size(), alone + 1);
  options.noise_model = NoiseModel::kColoured;
  EXPECT_EQ(run_options(files, options).faults().size(), alone + 2);
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

TEST(ReconstructOptions, LeavesHaveWholeSlabs) {
  EXPECT_EQ(option_table::row_of("field.leaf_size").range.low, kernels::kLanes);
}

TEST(ReconstructOptions, OnlyFactorsOfAUniformTreeBeginAsVertices) {
  if (!fit::can_solve_integer_programs()) GTEST_SKIP() << "this build is without COIN-OR CBC";
  const auto num_faults = [](FieldKind kind, TreeKind tree, Engine engine) {
    Options options = good_options();
    options.vertex_epochs = 3;
    options.field = kind;
    options.tree = tree;
    options.engine = engine;
    return faults_of(options).size();
  };
  EXPECT_EQ(num_faults(FieldKind::kVm, TreeKind::kUniform, Engine::kSlab), 0u);
  EXPECT_EQ(num_faults(FieldKind::kGrid, TreeKind::kUniform, Engine::kSlab), 1u);
  EXPECT_EQ(num_faults(FieldKind::kVm, TreeKind::kAdaptive, Engine::kSlab), 1u);
  EXPECT_EQ(num_faults(FieldKind::kVm, TreeKind::kUniform, Engine::kRay), 1u);
}

TEST(ReconstructOptions, ABudgetIsForAdaptiveTrees) {
  if (!fit::can_solve_integer_programs()) GTEST_SKIP() << "this build is without COIN-OR CBC";
  Options options = good_options();
  options.leaf_budget = 12;
  EXPECT_EQ(faults_of(options).size(), 1u);
  options.tree = TreeKind::kAdaptive;
  EXPECT_TRUE(faults_of(options).empty());
  options.leaf_budget = -1;
  EXPECT_EQ(faults_of(options).size(), 1u);
}

TEST(ResolvedOptions, FollowOtherOptions) {
  const Options usual = resolve({}, good_options());
  EXPECT_EQ(usual.field, FieldKind::kGrid);
  EXPECT_EQ(usual.leaf_size, 64);
  EXPECT_EQ(usual.epochs, 10);
  EXPECT_EQ(usual.vertex_epochs, 0);
  EXPECT_EQ(usual.coarse_epochs, 160);
  EXPECT_EQ(usual.learning_rate, 0.035);
  EXPECT_EQ(usual.activation, Activation::kIdentity);  // dark contrast
  EXPECT_FALSE(usual.fit_view_scale);                  // trials choose it

  Options requested = good_options();
  requested.field = FieldKind::kVm;
  const Options factors = resolve({}, requested);
  EXPECT_EQ(factors.leaf_size, 32);
  EXPECT_EQ(factors.epochs, 10);
  EXPECT_EQ(factors.vertex_epochs, 10);
  EXPECT_EQ(factors.coarse_epochs, 160);
  EXPECT_EQ(factors.learning_rate, 0.05);

  requested.field = FieldKind::kGrid;
  requested.epochs = 5;
  requested.contrast = Contrast::kBright;
  const Options grid = resolve({}, requested);
  EXPECT_EQ(grid.leaf_size, 64);
  EXPECT_EQ(grid.epochs, 5);
  EXPECT_EQ(grid.vertex_epochs, 0);
  EXPECT_EQ(grid.coarse_epochs, 80);  // half of the usual, as the epochs are
  EXPECT_EQ(grid.learning_rate, 0.035);
  EXPECT_EQ(grid.activation, Activation::kSoftplus);
}

TEST(ResolvedOptions, AContrastTransferTakesMoreEpochs) {
  Options options = good_options();
  EXPECT_EQ(resolve({}, options).epochs, 10);
  SeriesFiles files;
  files.ctf = "ctf.txt";
  EXPECT_EQ(resolve(files, options).epochs, 20);
  files.ctf = "none";
  EXPECT_EQ(resolve(files, options).epochs, 10);
  options.defocus_um = 3.0;
  EXPECT_EQ(resolve({}, options).epochs, 20);
  EXPECT_EQ(resolve({}, options).coarse_epochs, 160);
}

TEST(ResolvedOptions, HaveFactorsWhereOtherOptionsAreForThem) {
  Options adaptive = good_options(), begun = good_options();
  adaptive.tree = TreeKind::kAdaptive;
  begun.vertex_epochs = 4;
  EXPECT_EQ(resolve({}, adaptive).field, FieldKind::kVm);
  EXPECT_EQ(resolve({}, begun).field, FieldKind::kVm);
  begun.field = FieldKind::kGrid;
  EXPECT_EQ(resolve({}, begun).field, FieldKind::kGrid);
}

TEST(ResolvedOptions, KeepWhatIsGiven) {
  Options requested = good_options();
  requested.field = FieldKind::kVm;
  requested.leaf_size = 48;
  requested.epochs = 3;
  requested.vertex_epochs = 2;
  requested.coarse_epochs = 0;
  requested.learning_rate = 0.2;
  requested.density_variation = 1.5;
  requested.penalty = Penalty::kSmooth;
  requested.activation = Activation::kSoftplus;
  requested.fit_view_scale = false;
  EXPECT_EQ(json_text(resolve({}, requested)), json_text(requested));
}

TEST(ResolvedOptions, StayTheSameWhenResolvedAgain) {
  for (const FieldKind kind : {FieldKind::kVm, FieldKind::kGrid}) {
    for (const TreeKind tree : {TreeKind::kUniform, TreeKind::kAdaptive}) {
      Options options = good_options();
      options.field = kind;
      options.tree = tree;
      const Options resolved = resolve({}, options);
      EXPECT_EQ(json_text(resolve({}, resolved)), json_text(resolved));
    }
  }
}

TEST(ResolvedOptions, TrialsChooseWhatIsNotGiven) {
  const Options open = resolve({}, good_options());
  EXPECT_FALSE(open.penalty || open.density_variation);
  const ReconstructOptions run = run_options({}, good_options());
  EXPECT_TRUE(run.open.variation);
  EXPECT_EQ(run.resolved.penalty, Penalty::kConcave);  // the trials start from it
  EXPECT_EQ(run.fit.density_variation, 14);

  Options smooth = good_options();
  smooth.penalty = Penalty::kSmooth;
  EXPECT_FALSE(run_options({}, smooth).open.variation);
  EXPECT_EQ(run_options({}, smooth).fit.density_variation, 5);

  Options weighted = good_options();
  weighted.density_variation = 3;
  EXPECT_FALSE(run_options({}, weighted).open.variation);
  EXPECT_EQ(run_options({}, weighted).fit.penalty, Penalty::kConcave);

  Options corrected = good_options();
  EXPECT_TRUE(run_options({}, corrected).open.view_scale);
  corrected.fit_view_scale = true;
  EXPECT_FALSE(run_options({}, corrected).open.view_scale);
  corrected.contrast = Contrast::kDark;
  EXPECT_FALSE(run_options({}, corrected).open.background);
  EXPECT_FALSE(run_options({}, corrected).open.beads);
  corrected.contrast = Contrast::kBright;
  EXPECT_TRUE(run_options({}, corrected).open.background);
  EXPECT_TRUE(run_options({}, corrected).open.beads);
  corrected.bead_diameter_nm = 0;
  EXPECT_FALSE(run_options({}, corrected).open.beads);
}

}  // namespace
}  // namespace tomofield::options
