#include "options/run_options.h"

#include <gtest/gtest.h>

#include <string>
#include <type_traits>

#include "base/check.h"
#include "fit/constants.h"
#include "fit/fit.h"
#include "fit/integer_program.h"
#include "kernels/lanes.h"
#include "measurement/prepare.h"
#include "option_table/values.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::options {
namespace {

// Each layer takes the section of the public options that is for it, as it is.
static_assert(std::is_base_of_v<ViewOptions, tilt_series::TiltSeriesOptions>);
static_assert(std::is_base_of_v<SeriesFiles, tilt_series::TiltSeriesOptions>);
static_assert(std::is_constructible_v<fit::Fit, const measurement::Measurement&,
                                      const FieldOptions&, const FitOptions&>);
static_assert(std::is_invocable_v<decltype(measurement::plan_measurement),
                                  const tilt_series::TiltSeries&, const SpecimenOptions&>);

Options good_options() {
  Options options;
  options.specimen.thickness = 100;
  return options;
}

std::vector<std::string> faults_of(const Options& options) {
  return run_options({}, options).faults();
}

std::string json_text(const Options& options) {
  return option_table::to_json({{}, options}).dump();
}

TEST(ReconstructOptions, DefaultsAreSound) { EXPECT_TRUE(faults_of(good_options()).empty()); }

TEST(ReconstructOptions, EveryFaultIsNamedAtOnce) {
  Options options = good_options();
  options.specimen.thickness = 0;
  options.field.leaf_size = 24;
  options.field.rank = 0;
  options.fit.subsets = 0;
  options.run.checkpoint_minutes = -1;
  EXPECT_EQ(faults_of(options).size(), 5u);
  const std::string message =
      testing::message_of<Error>([&] { base::require_no_faults(faults_of(options)); });
  for (const char* word :
       {"--thickness", "--leaf-size", "24", "--rank", "--subsets", "--checkpoint-minutes"})
    EXPECT_NE(message.find(word), std::string::npos) << word << " in " << message;
}

TEST(ReconstructOptions, WhatFiltersViewsNeedsTheSlabEngine) {
  Options options = good_options();
  options.fit.engine = Engine::kRay;
  const std::size_t alone = faults_of(options).size();
  SeriesFiles files;
  files.mtf = "detector.star";
  const ReconstructOptions with_mtf = run_options(files, options);
  EXPECT_TRUE(with_mtf.filters_views());
  EXPECT_EQ(with_mtf.faults().size(), alone + 1);
  options.fit.noise_model = NoiseModel::kColoured;
  EXPECT_EQ(run_options(files, options).faults().size(), alone + 2);
}

TEST(ReconstructOptions, LargeLeavesOfAUniformTreeAreRootCells) {
  FieldOptions field;
  EXPECT_EQ(fit::usual_leaf_size(field), field.leaf_size);
  EXPECT_EQ(fit::depth_of(field), 1);
  field.kind = FieldKind::kGrid;
  field.leaf_size = fit::usual_leaf_size(field);
  EXPECT_GT(*field.leaf_size, *FieldOptions{}.leaf_size);
  EXPECT_EQ(fit::depth_of(field), 0);
  field.tree = TreeKind::kAdaptive;  // whose leaves may become twice as wide
  EXPECT_EQ(fit::usual_leaf_size(field), FieldOptions{}.leaf_size);
  EXPECT_EQ(fit::depth_of(field), 1);
}

TEST(ReconstructOptions, LeavesHaveWholeSlabs) {
  EXPECT_EQ(option_table::row_of("field.leaf_size").range.low, kernels::kLanes);
}

TEST(ReconstructOptions, OnlyFactorsOfAUniformTreeBeginAsVertices) {
  if (!fit::can_solve_integer_programs()) GTEST_SKIP() << "this build is without COIN-OR CBC";
  const auto num_faults = [](FieldKind kind, TreeKind tree, Engine engine) {
    Options options = good_options();
    options.fit.vertex_epochs = 3;
    options.field.kind = kind;
    options.field.tree = tree;
    options.fit.engine = engine;
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
  options.field.leaf_budget = 12;
  EXPECT_EQ(faults_of(options).size(), 1u);
  options.field.tree = TreeKind::kAdaptive;
  EXPECT_TRUE(faults_of(options).empty());
  options.field.leaf_budget = -1;
  EXPECT_EQ(faults_of(options).size(), 1u);
}

TEST(ResolvedOptions, FollowOtherOptions) {
  const Options usual = resolve({}, good_options());
  EXPECT_EQ(usual.field.kind, FieldKind::kGrid);
  EXPECT_EQ(usual.field.leaf_size, 64);
  EXPECT_EQ(usual.fit.epochs, 10);
  EXPECT_EQ(usual.fit.vertex_epochs, 0);
  EXPECT_EQ(usual.fit.coarse_epochs, 160);
  EXPECT_EQ(usual.fit.learning_rate, 0.035);
  EXPECT_EQ(usual.field.activation, Activation::kIdentity);  // dark contrast
  EXPECT_TRUE(usual.fit.fit_view_scale.is_open());           // trials choose it

  Options requested = good_options();
  requested.field.kind = FieldKind::kVm;
  const Options factors = resolve({}, requested);
  EXPECT_EQ(factors.field.leaf_size, 32);
  EXPECT_EQ(factors.fit.epochs, 10);
  EXPECT_EQ(factors.fit.vertex_epochs, 10);
  EXPECT_EQ(factors.fit.coarse_epochs, 160);
  EXPECT_EQ(factors.fit.learning_rate, 0.05);

  requested.field.kind = FieldKind::kGrid;
  requested.fit.epochs = 5;
  requested.views.contrast = Contrast::kBright;
  const Options grid = resolve({}, requested);
  EXPECT_EQ(grid.field.leaf_size, 64);
  EXPECT_EQ(grid.fit.epochs, 5);
  EXPECT_EQ(grid.fit.vertex_epochs, 0);
  EXPECT_EQ(grid.fit.coarse_epochs, 80);  // half of the usual, as the epochs are
  EXPECT_EQ(grid.fit.learning_rate, 0.035);
  EXPECT_EQ(grid.field.activation, Activation::kSoftplus);
}

TEST(ResolvedOptions, AContrastTransferTakesMoreEpochs) {
  Options options = good_options();
  EXPECT_EQ(resolve({}, options).fit.epochs, 10);
  SeriesFiles files;
  files.ctf = "ctf.txt";
  EXPECT_EQ(resolve(files, options).fit.epochs, 20);
  files.ctf = "none";
  EXPECT_EQ(resolve(files, options).fit.epochs, 10);
  options.views.defocus_um = 3.0;
  EXPECT_EQ(resolve({}, options).fit.epochs, 20);
  EXPECT_EQ(resolve({}, options).fit.coarse_epochs, 160);
}

TEST(ResolvedOptions, HaveFactorsWhereOtherOptionsAreForThem) {
  Options adaptive = good_options(), begun = good_options();
  adaptive.field.tree = TreeKind::kAdaptive;
  begun.fit.vertex_epochs = 4;
  EXPECT_EQ(resolve({}, adaptive).field.kind, FieldKind::kVm);
  EXPECT_EQ(resolve({}, begun).field.kind, FieldKind::kVm);
  begun.field.kind = FieldKind::kGrid;
  EXPECT_EQ(resolve({}, begun).field.kind, FieldKind::kGrid);
}

TEST(ResolvedOptions, KeepWhatIsGiven) {
  Options requested = good_options();
  requested.field.kind = FieldKind::kVm;
  requested.field.leaf_size = 48;
  requested.fit.epochs = 3;
  requested.fit.vertex_epochs = 2;
  requested.fit.coarse_epochs = 0;
  requested.fit.learning_rate = 0.2;
  requested.fit.density_variation = 1.5;
  requested.fit.penalty = Penalty::kSmooth;
  requested.field.activation = Activation::kSoftplus;
  requested.fit.fit_view_scale = false;
  EXPECT_EQ(json_text(resolve({}, requested)), json_text(requested));
}

TEST(ResolvedOptions, StayTheSameWhenResolvedAgain) {
  for (const FieldKind kind : {FieldKind::kVm, FieldKind::kGrid}) {
    for (const TreeKind tree : {TreeKind::kUniform, TreeKind::kAdaptive}) {
      Options options = good_options();
      options.field.kind = kind;
      options.field.tree = tree;
      const Options resolved = resolve({}, options);
      EXPECT_EQ(json_text(resolve({}, resolved)), json_text(resolved));
    }
  }
}

TEST(ResolvedOptions, TrialsChooseWhatIsNotGiven) {
  const Options open = resolve({}, good_options());
  EXPECT_TRUE(open.fit.penalty.is_open() && open.fit.density_variation.is_open());
  const ReconstructOptions run = run_options({}, good_options());
  EXPECT_TRUE(run.open_settings().variation);
  EXPECT_EQ(run.fit.penalty, Penalty::kConcave);  // the trials start from it
  EXPECT_EQ(run.fit.density_variation, 14);

  Options smooth = good_options();
  smooth.fit.penalty = Penalty::kSmooth;
  EXPECT_FALSE(run_options({}, smooth).open_settings().variation);
  EXPECT_EQ(run_options({}, smooth).fit.density_variation, 5);

  Options weighted = good_options();
  weighted.fit.density_variation = 3;
  EXPECT_FALSE(run_options({}, weighted).open_settings().variation);
  EXPECT_EQ(run_options({}, weighted).fit.penalty, Penalty::kConcave);

  Options corrected = good_options();
  EXPECT_TRUE(run_options({}, corrected).open_settings().view_scale);
  corrected.fit.fit_view_scale = true;
  EXPECT_FALSE(run_options({}, corrected).open_settings().view_scale);
  corrected.views.contrast = Contrast::kDark;
  EXPECT_FALSE(run_options({}, corrected).open_settings().background);
  EXPECT_FALSE(run_options({}, corrected).open_settings().beads);
  corrected.views.contrast = Contrast::kBright;
  EXPECT_TRUE(run_options({}, corrected).open_settings().background);
  EXPECT_TRUE(run_options({}, corrected).open_settings().beads);
  corrected.views.bead_diameter_nm = 0;
  EXPECT_FALSE(run_options({}, corrected).open_settings().beads);
}

TEST(DenoiseFactor, IsThatOfAPlaceOrANumber) {
  EXPECT_EQ(denoise_factor("light"), 0.5);
  EXPECT_EQ(denoise_factor("medium"), 1.0);
  EXPECT_EQ(denoise_factor("strong"), 2.0);
  EXPECT_EQ(denoise_factor("1.25"), 1.25);
  for (const char* wrong : {"", "Strong", "0", "-1", "21", "nan", "inf", "1.5x", "medium "})
    EXPECT_THROW(denoise_factor(wrong), Error) << wrong;
}

}  // namespace
}  // namespace tomofield::options
