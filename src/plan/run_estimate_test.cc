#include "plan/run_estimate.h"

#include <gtest/gtest.h>

#include <string>

#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tomofield/options.h"

namespace tomofield::plan {
namespace {

constexpr std::int64_t kSize = 48;
constexpr int kNumViews = 15;

// Estimates reconstructions of a small series.
class Estimate : public ::testing::Test {
 protected:
  Estimate() {
    files_.stack = testing::write_stack(scratch_ / "series.mrc", kSize, kSize, kNumViews,
                                        testing::some_value, 2.5);
    std::string tilts;
    for (int view = 0; view < kNumViews; ++view) tilts += std::to_string(8 * view - 56) + "\n";
    files_.tlt = scratch_.write("series.tlt", tilts);
    options_.views.contrast = Contrast::kBright;
    options_.specimen.thickness = 24;
    options_.field.with_margin = false;
    options_.field.leaf_size = 16;
    options_.fit.epochs = 2;
    options_.fit.coarse_epochs = 0;
    options_.fit.density_variation = 5;
    options_.fit.penalty = Penalty::kConcave;
    options_.fit.fit_view_scale = false;
    options_.views.black_level = 0;
    options_.run.output = scratch_ / "out.mrc";
  }

  RunPlan plan() const {
    const options::ReconstructOptions run = options::run_options(files_, options_);
    return plan_run(tilt_series::PlannedSeries(run.input()), run);
  }
  RunEstimate estimate() const {
    const options::ReconstructOptions run = options::run_options(files_, options_);
    const tilt_series::PlannedSeries series(run.input());
    return estimate_run(series, run, plan_run(series, run));
  }

  testing::ScratchDirectory scratch_;
  SeriesFiles files_;
  Options options_;
};

TEST_F(Estimate, CountsTheSamplesOfAllSteps) {
  options_.field.kind = FieldKind::kGrid;
  const RunEstimate two_epochs = estimate();
  options_.fit.epochs = 6;
  const RunEstimate six_epochs = estimate();
  EXPECT_DOUBLE_EQ(six_epochs.sample_steps, 3 * two_epochs.sample_steps);
  // An epoch has a step for every view, of all voxels and some padding.
  const double voxels = kSize * kSize * 24;
  EXPECT_GT(two_epochs.sample_steps, 2 * kNumViews * voxels);
  EXPECT_LT(two_epochs.sample_steps, 2 * kNumViews * voxels * 1.3);
}

TEST_F(Estimate, TrialsAndFactorsAreMoreWork) {
  const double alone = estimate().sample_steps;
  options_.fit.penalty = FitOptions().penalty;
  options_.fit.density_variation = FitOptions().density_variation;
  EXPECT_GT(estimate().sample_steps, alone);
  options_.field.kind = FieldKind::kVm;
  ASSERT_TRUE(estimate().core_seconds.has_value());
  EXPECT_GT(*estimate().core_seconds, 0);
}

TEST_F(Estimate, AnAlignmentIsMoreWork) {
  const double alone = estimate().sample_steps;
  options_.run.align = Alignment::kRefine;
  const double refined = estimate().sample_steps;
  EXPECT_GT(refined, alone);
  options_.run.align = Alignment::kFull;
  EXPECT_GT(estimate().sample_steps, refined);
}

TEST_F(Estimate, FilteredViewsAreMoreWorkAndMemory) {
  options_.views.pixel_size_A = 10;
  const double alone = estimate().sample_steps;
  const std::size_t memory = plan().memory_bytes;
  options_.views.defocus_um = 4;
  EXPECT_GT(estimate().sample_steps, alone);
  EXPECT_GT(plan().memory_bytes, memory);
  // A dose filters the views as well.
  options_.views.defocus_um.reset();
  options_.views.dose_per_tilt = 3;
  EXPECT_GT(estimate().sample_steps, alone);
}

TEST_F(Estimate, DiskHoldsTheResultsAndTwoCheckpoints) {
  const RunEstimate estimated = estimate();
  const auto voxels = static_cast<std::size_t>(kSize * kSize * 24);
  EXPECT_GT(estimated.result_bytes, 4 * voxels);
  EXPECT_GT(estimated.disk_bytes, estimated.result_bytes);
  options_.volume.voxel_type = VoxelType::kFloat16;
  EXPECT_EQ(estimate().result_bytes, estimated.result_bytes - 2 * voxels);
  options_.volume.zarr = true;
  EXPECT_GE(estimate().result_bytes, estimated.result_bytes);  // 2 bytes a voxel, and more
  options_.volume.zarr = false;
  options_.fit.split_tilts = true;
  const std::size_t of_halves = estimate().result_bytes;
  options_.fit.denoising_halves = true;
  EXPECT_EQ(estimate().result_bytes, of_halves + 2 * 2 * voxels);
}

TEST_F(Estimate, TheTimeOfTheRayEngineIsNotKnown) {
  options_.fit.engine = Engine::kRay;
  EXPECT_FALSE(estimate().core_seconds.has_value());
}

}  // namespace
}  // namespace tomofield::plan
