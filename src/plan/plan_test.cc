#include <gtest/gtest.h>

#include <string>

#include "base/log.h"
#include "base/system/memory.h"
#include "pixel_stack.h"
#include "plan/plan.h"
#include "scratch_directory.h"
#include "tomofield/error.h"
#include "tomofield/options.h"

namespace tomofield::plan {
namespace {

constexpr std::int64_t kWidth = 64, kHeight = 48;
constexpr int kNumViews = 15;

// Plans reconstructions of a small series.
class Plan : public ::testing::Test {
 protected:
  Plan() {
    options_.views.contrast = Contrast::kBright;
    options_.files.stack = testing::write_stack(scratch_ / "series.mrc", kWidth, kHeight, kNumViews,
                                                testing::some_value, 2.5);
    std::string tilts;
    for (int view = 0; view < kNumViews; ++view) tilts += std::to_string(8 * view - 56) + "\n";
    options_.files.tlt = scratch_.write("series.tlt", tilts);
    options_.specimen.thickness = 24;
    options_.fit.penalty = Penalty::kConcave;
    options_.fit.fit_view_scale = false;
    options_.field.kind = FieldKind::kGrid;
    options_.field.leaf_size = 16;
    options_.field.with_margin = false;
    options_.fit.epochs = 5;
    options_.fit.subsets = 4;
  }

  RunPlan plan() const { return plan_run(tilt_series::PlannedSeries(options_.input()), options_); }

  testing::ScratchDirectory scratch_;
  options::ReconstructOptions options_;
};

TEST_F(Plan, HasTheSizesOfTheSeriesAndTheField) {
  const RunPlan run = plan();
  EXPECT_EQ(run.num_views, kNumViews);
  EXPECT_EQ(run.view_width, kWidth);
  EXPECT_EQ(run.view_height, kHeight);
  EXPECT_NEAR(run.pixel_size_A, 2.5, 1e-6);
  EXPECT_EQ(run.thickness, 24);
  EXPECT_EQ(run.roi.width(), kWidth);
  EXPECT_EQ(run.roi.height(), kHeight);
  // Root cells are 32 px high, so the height of 48 px takes two rows of them.
  constexpr std::size_t kLeaves = 16, kN = 17, kNz = 24;
  EXPECT_EQ(run.num_leaves, static_cast<int>(kLeaves));
  EXPECT_EQ(run.num_parameters, kLeaves * kN * kN * kNz);
  options_.field.kind = FieldKind::kVm;
  options_.field.rank = 5;
  EXPECT_EQ(plan().num_parameters, kLeaves * 5 * (2 * kN + kNz + kN * kN + 2 * kN * kNz));
}

TEST_F(Plan, BinnedViewsAndARegionOfInterestAreSmaller) {
  options_.views.bin = 2;
  options_.specimen.roi = Rectangle{8, 4, 56, 44};
  const RunPlan run = plan();
  EXPECT_EQ(run.view_width, kWidth / 2);
  EXPECT_EQ(run.view_height, kHeight / 2);
  EXPECT_NEAR(run.pixel_size_A, 5.0, 1e-6);
  EXPECT_EQ(run.thickness, 12);
  EXPECT_EQ(run.roi.width(), 24);
  EXPECT_EQ(run.roi.height(), 20);
}

TEST_F(Plan, CountsTheMemoryOfTrialsThatTheViewsMayAskFor) {
  options_.fit.spike_rank = 3;
  options_.fit.density_variation = 5;
  options_.fit.prior = Prior::kTv;
  options_.field.leaf_size = 512;
  options_.views.black_level = 0.0;
  options_.views.bead_diameter_nm = 0.0;
  const std::size_t without = plan().memory_bytes;
  EXPECT_TRUE(plan().has_large_leaves);
  options_.views.black_level = {};  // a background, if there is one
  EXPECT_GT(plan().memory_bytes, without + without / 2);
  options_.field.leaf_size = 32;
  EXPECT_FALSE(plan().has_large_leaves);
}

TEST_F(Plan, CountsTheStepsOfAllStages) {
  EXPECT_EQ(plan().num_steps, 5 * 4);
  options_.fit.coarse_epochs = 8;
  options_.field.leaf_size = 32;
  const RunPlan coarse = plan();
  EXPECT_EQ(coarse.num_steps, (5 + 8) * 4);
  std::int64_t epochs = 0;
  for (const fit::Stage& stage : coarse.stages) epochs += stage.epochs;
  EXPECT_EQ(epochs, 5 + 8);
  EXPECT_GT(coarse.stages.front().bin, 1);
  EXPECT_EQ(coarse.stages.back().bin, 1);
}

TEST_F(Plan, AnEpochHasAtMostOneStepForEachFittedView) {
  options_.fit.subsets = 100;
  EXPECT_EQ(plan().num_steps, 5 * kNumViews);
  options_.fit.hold_out = 5;  // positions 2, 7 and 12
  EXPECT_EQ(plan().num_steps, 5 * (kNumViews - 3));
}

TEST_F(Plan, CountsTheTrials) {
  EXPECT_EQ(plan().num_trials, 0);
  options_.fit.fit_view_scale = Choice<bool>::usual(false);
  EXPECT_EQ(plan().num_trials, 2);
  options_.fit.penalty = FitOptions().penalty;
  options_.fit.spike_rank = 3;
  EXPECT_EQ(plan().num_trials, 5);
  options_.fit.hold_out = 3;  // 10 views are left, and short trials need 12
  EXPECT_EQ(plan().num_trials, 0);
  options_.fit.tune = true;
  EXPECT_GT(plan().num_trials, 2);
  options_.fit.hold_out = 2;
  options_.views.exclude = "1-9";
  const std::string message = testing::message_of<Error>([&] { plan(); });
  EXPECT_NE(message.find("views"), std::string::npos) << message;
}

TEST_F(Plan, MoreParametersNeedMoreMemory) {
  const std::size_t few = plan().memory_bytes;
  options_.field.vertex_spacing = 0.25;
  const RunPlan fine = plan();
  // The parameters, their gradient and two moments of floats.
  EXPECT_GT(fine.memory_bytes, few);
  EXPECT_GE(fine.memory_bytes, 16 * fine.num_parameters);
}

TEST_F(Plan, NoBudgetOfLeavesCountsMoreThanTheTreeCanBecome) {
  options_.field.kind = FieldKind::kVm;
  options_.field.tree = TreeKind::kAdaptive;
  const RunPlan at_start = plan();
  options_.field.leaf_budget = 1'000'000'000;
  const RunPlan all_halved = plan();
  EXPECT_GT(all_halved.num_parameters, at_start.num_parameters);
  EXPECT_LE(all_halved.num_parameters, 4 * at_start.num_parameters);
}

TEST_F(Plan, CountsTheMomentsOfLeavesThatRaysMeetAlone) {
  options_.fit.density_variation = 5;
  options_.fit.prior = Prior::kTv;
  options_.fit.coarse_epochs = 4;
  options_.field.leaf_size = 512;
  options_.field.tree = TreeKind::kAdaptive;  // whose roots are four leaves
  options_.field.kind = FieldKind::kGrid;
  options_.field.rank = 4;
  options_.specimen.roi = Rectangle{0, 0, 16, 16};
  options_.views.black_level = 0.0;
  options_.views.bead_diameter_nm = 0.0;
  const RunPlan run = plan();
  ASSERT_EQ(run.num_trials, 0);
  EXPECT_GE(run.memory_bytes, 7 * run.num_parameters);   // all parameters, and 3 more of a quarter
  EXPECT_LT(run.memory_bytes, 16 * run.num_parameters);  // 3 more of all
}

TEST_F(Plan, CountsTheLeavesThatTheRayEngineCopies) {
  options_.fit.engine = Engine::kRay;
  options_.field.leaf_size = 512;  // one leaf has nearly all parameters
  const RunPlan run = plan();
  // Beside the four numbers of a parameter: a leaf that is traced, and one that loses its spikes.
  EXPECT_GE(run.memory_bytes, 22 * run.num_parameters);
}

TEST_F(Plan, CountsTheRaysThatMeetTheRegionAlone) {
  options_.fit.engine = Engine::kRay;
  options_.fit.ray_samples = 100000;
  const std::size_t whole = plan().memory_bytes;
  options_.specimen.roi = Rectangle{24, 16, 40, 32};
  // A third of the rows, and less than a half of their rays.
  EXPECT_LT(plan().memory_bytes, whole / 6);
}

TEST_F(Plan, CountsCopiesOfATreeThatChangesAlone) {
  options_.field.kind = FieldKind::kVm;
  options_.field.rank = 300;
  options_.field.tree = TreeKind::kAdaptive;
  options_.fit.prior = Prior::kTv;
  options_.fit.spike_rank = 3;
  const std::size_t changing = plan().memory_bytes;
  options_.fit.epochs = 4;
  EXPECT_LT(plan().memory_bytes, changing - 8 * plan().num_parameters);
}

TEST_F(Plan, RefusesWhatTheMachineCannotHold) {
  RunPlan run = plan();
  EXPECT_NO_THROW(require_memory(run));
  run.memory_bytes = std::size_t{1} << 50;
  const std::string message = testing::message_of<Error>([&] { require_memory(run); });
  EXPECT_NE(message.find("GiB"), std::string::npos) << message;
  EXPECT_NE(message.find("--bin"), std::string::npos) << message;
}

TEST_F(Plan, RefusesTooFewViewsForAnAlignmentBeforeIt) {
  options_.run.align = Alignment::kRefine;
  plan();
  check_before_reading(options_);
  check_alignment_alone(options_);
  options_.views.exclude = "1-4";
  const auto refusal = [](const auto& check) {
    const std::string message = testing::message_of<Error>(check);
    EXPECT_NE(message.find("at least 12 views"), std::string::npos) << message;
    EXPECT_NE(message.find("11"), std::string::npos) << message;
  };
  refusal([&] { plan(); });
  refusal([&] { check_before_reading(options_); });
  refusal([&] { check_alignment_alone(options_); });
  options_.alignment.emplace();  // it may have left views out
  plan();
}

TEST_F(Plan, RefusesTooMuchMemoryBeforeAnyViewIsRead) {
  options_.files.stack =
      testing::write_stack(scratch_ / "wide.mrc", 512, 512, kNumViews, testing::some_value, 2.5);
  options_.specimen.thickness = 1e6;
  const auto refusal = [](const auto& check) {
    const std::string message = testing::message_of<Error>(check);
    EXPECT_NE(message.find("GiB"), std::string::npos) << message;
  };
  refusal([&] { check_before_reading(options_); });
  refusal([&] { check_alignment_alone(options_); });
}

TEST_F(Plan, BeforeAnAlignmentIsSilent) {
  options_.run.align = Alignment::kRefine;
  options_.files.stack = testing::write_stack(scratch_ / "unscaled.mrc", kWidth, kHeight, kNumViews,
                                              testing::some_value, 1.0);
  int num_messages = 0;
  base::set_log_sink([&](base::LogLevel, std::string_view) { ++num_messages; });
  check_before_reading(options_);
  EXPECT_EQ(num_messages, 0);
  base::log_info("the pause is over");
  EXPECT_EQ(num_messages, 1);
  base::set_log_sink({});
}

}  // namespace
}  // namespace tomofield::plan
