#include "measurement/undecided_beads.h"

#include <gtest/gtest.h>

#include <numeric>
#include <stdexcept>
#include <vector>

#include "bead_series.h"
#include "measurement/prepare.h"

namespace tomofield::measurement {
namespace {

using testing::BeadScene;
using tilt_series::BeadMasking;

constexpr int kNumViews = 31;

// A bright series with beads, some rows of which are fitted.
class BrightBeads {
 public:
  explicit BrightBeads(bool resample = true) {
    scene_.scatter_beads(12, 5);
    input_.images = scene_.stack(Contrast::kBright);
    input_.contrast = Contrast::kBright;
    input_.resample = resample;
    specimen_.thickness = 40;
    specimen_.roi = Rectangle{0, 13, scene_.width, 110};
    undecided_ = prepared();
  }

  const Measurement& undecided() const { return undecided_; }
  // The same with beads that the user asks to be masked.
  Measurement masked() const {
    tilt_series::TiltSeriesOptions input = input_;
    input.bead_diameter_nm = undecided_.masks.bead_diameter_A / 10;
    return prepared(input);
  }
  Measurement prepared() const { return prepared(input_); }

 private:
  Measurement prepared(const tilt_series::TiltSeriesOptions& input) const {
    return prepare_measurement(tilt_series::TiltSeries(input), specimen_, "/tmp");
  }

  BeadScene scene_;
  tilt_series::TiltSeriesOptions input_;
  SpecimenOptions specimen_;
  Measurement undecided_;
};

std::vector<int> all_views() {
  std::vector<int> views(kNumViews);
  std::iota(views.begin(), views.end(), 0);
  return views;
}

TEST(UndecidedBeads, CountInTheRaysButNotInTheStatistics) {
  const BrightBeads series;
  const Measurement& undecided = series.undecided();
  const Measurement masked = series.masked();
  EXPECT_EQ(undecided.masks.bead_masking, BeadMasking::kUndecided);
  EXPECT_EQ(undecided.undecided_beads.size(), 31u);
  EXPECT_EQ(undecided.masked_part, std::vector<double>(kNumViews, 0.0));
  EXPECT_EQ(undecided.unit, masked.unit);
  EXPECT_EQ(undecided.mean_density, masked.mean_density);
  EXPECT_EQ(undecided.noise_sigma, masked.noise_sigma);
  EXPECT_NE(undecided.rays->checksum(), masked.rays->checksum());
}

TEST(UndecidedBeads, HiddenOnesAreThoseThatTheUserMasks) {
  for (const bool resample : {true, false}) {
    const BrightBeads series(resample);
    const Measurement masked = series.masked();
    Measurement hidden = series.prepared();
    hide_beads(hidden);
    EXPECT_EQ(hidden.rays->checksum(), masked.rays->checksum()) << "resampled: " << resample;
    EXPECT_EQ(hidden.masked_part, masked.masked_part);
    EXPECT_EQ(hidden.masks.bead_masking, BeadMasking::kMasked);
    EXPECT_EQ(hidden.masks.beads_masked, masked.masks.beads_masked);
    EXPECT_TRUE(hidden.undecided_beads.empty());
  }
}

TEST(UndecidedBeads, KeptOnesChangeNoRay) {
  const BrightBeads series;
  Measurement kept = series.undecided();
  keep_beads(kept);
  EXPECT_EQ(kept.rays, series.undecided().rays);
  EXPECT_EQ(kept.masks.bead_masking, BeadMasking::kUnmasked);
  EXPECT_TRUE(kept.undecided_beads.empty());
}

TEST(UndecidedBeads, RaysThatACopySharesAreNotHidden) {
  const BrightBeads series;
  Measurement copy = series.undecided();
  EXPECT_THROW(hide_beads(copy), std::logic_error);
}

TEST(UndecidedBeads, ATrialHidesThemInTheViewsThatItNames) {
  const BrightBeads series;
  const std::vector<int> chosen = {0, 2, 5, 15, 22, 30};
  const Measurement trial = middle_rows(series.undecided(), 40, chosen);
  const Measurement masked = middle_rows(series.masked(), 40, chosen);
  const std::vector<int> all = {0, 1, 2, 3, 4, 5}, held_out = {1, 4};
  const std::uint64_t before = trial.rays->checksum();
  const Measurement with_masks = with_beads_hidden(trial, all);
  EXPECT_EQ(with_masks.rays->checksum(), masked.rays->checksum());
  EXPECT_EQ(with_masks.masks.bead_masking, BeadMasking::kMasked);
  const Measurement without = with_beads_hidden(trial, held_out);
  EXPECT_EQ(without.masks.bead_masking, BeadMasking::kUnmasked);
  EXPECT_TRUE(without.undecided_beads.empty());
  for (int view = 0; view < 6; ++view) {
    const bool is_held_out = view == 1 || view == 4;
    EXPECT_EQ(without.rays->num_valid(view), (is_held_out ? masked : trial).rays->num_valid(view));
    EXPECT_EQ(without.masked_part[static_cast<std::size_t>(view)] > 0, is_held_out);
  }
  EXPECT_EQ(trial.rays->checksum(), before) << "the trial's own rays stay";
}

TEST(UndecidedBeads, DiscsFollowBinning) {
  const BrightBeads series;
  const Measurement coarse = binned(series.undecided(), 2);
  const Measurement hidden = with_beads_hidden(coarse, all_views());
  const Measurement reference = binned(series.masked(), 2);
  // Coarse pixels at the rim of a disc may differ.
  for (int view = 0; view < kNumViews; ++view) {
    const auto v = static_cast<std::size_t>(view);
    EXPECT_NEAR(hidden.rays->masked_parts()[v], reference.rays->masked_parts()[v],
                0.25 * reference.rays->masked_parts()[v]);
  }
}

TEST(UndecidedBeads, NothingIsDoneWhereNothingIsUndecided) {
  const BrightBeads series;
  Measurement masked = series.masked();
  const Measurement copy = masked;
  hide_beads(masked);
  keep_beads(masked);
  EXPECT_EQ(masked.masks.bead_masking, BeadMasking::kMasked);
  EXPECT_EQ(with_beads_hidden(masked, all_views()).rays, copy.rays);
}

}  // namespace
}  // namespace tomofield::measurement
