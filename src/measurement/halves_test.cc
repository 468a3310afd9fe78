#include "measurement/halves.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/random.h"
#include "measurement/background.h"
#include "measurement/prepare.h"
#include "measurement/undecided_beads.h"
#include "pixel_stack.h"
#include "scratch_directory.h"

namespace tomofield::measurement {
namespace {

using testing::ScratchDirectory;
using testing::write_stack;
using tilt_series::Half;

constexpr int kNumViews = 12;

float noise(std::int64_t x, std::int64_t y, std::int64_t view, std::uint64_t seed) {
  base::Random random(seed, static_cast<std::uint64_t>((view * 100 + y) * 100 + x));
  return static_cast<float>(random.normal());
}

float of_half(std::int64_t x, std::int64_t y, std::int64_t view, std::uint64_t seed) {
  const double wave = std::sin(0.2 * static_cast<double>(x + y));
  return 50 + 8 * static_cast<float>(wave) + noise(x, y, view, seed);
}

// A bright series of two halves of frames, whose sum has a dead pixel in one view.
class FrameHalves {
 public:
  FrameHalves() {
    const auto write = [&](const char* name, const testing::PixelFunction& value) {
      return write_stack(scratch_ / name, 40, 36, kNumViews, value);
    };
    options_.even = write("even.mrc", [](auto x, auto y, auto v) { return of_half(x, y, v, 1); });
    options_.odd = write("odd.mrc", [](auto x, auto y, auto v) { return of_half(x, y, v, 2); });
    options_.stack = write("all.mrc", [](auto x, auto y, auto v) {
      return x == 12 && y == 13 && v == 4 ? 1e6f : of_half(x, y, v, 1) + of_half(x, y, v, 2);
    });
    std::string angles;
    for (int v = 0; v < kNumViews; ++v) angles += fmt::format("{}\n", 10 * v - 55);
    options_.tlt = scratch_.write("a.tlt", angles);
    options_.contrast = Contrast::kBright;
  }
  tilt_series::TiltSeries series() const { return tilt_series::TiltSeries(options_); }

 private:
  ScratchDirectory scratch_;
  tilt_series::TiltSeriesOptions options_;
};

Measurement prepared(const tilt_series::TiltSeries& series) {
  SpecimenOptions specimen;
  specimen.thickness = 20;
  return prepare_measurement(series, specimen, "/tmp");
}

Measurement half(const tilt_series::TiltSeries& series, Half which, const Measurement& whole) {
  return half_of_frames(series, which, whole, "/tmp", whole.rays->shape().num_rows + 16);
}

TEST(HalvesOfFrames, HaveTheUnitsAndTheMasksOfAllFrames) {
  const FrameHalves frames;
  const tilt_series::TiltSeries series = frames.series();
  Measurement whole = prepared(series);
  ASSERT_GT(whole.background, 0);
  subtract_background(0.5, whole);
  const Measurement even = half(series, Half::kEven, whole), odd = half(series, Half::kOdd, whole);
  EXPECT_FALSE(whole.rays->counts(4, 12, 13));
  double mean = 0, difference = 0;
  int n = 0;
  for (int view = 0; view < kNumViews; ++view)
    for (std::int64_t y = 0; y < 36; ++y)
      for (std::int64_t x = 0; x < 40; ++x) {
        ASSERT_EQ(even.rays->counts(view, x, y), whole.rays->counts(view, x, y));
        ASSERT_EQ(odd.rays->counts(view, x, y), whole.rays->counts(view, x, y));
        if (!whole.rays->counts(view, x, y)) continue;
        const float e = even.rays->ray(view, x, y), o = odd.rays->ray(view, x, y);
        mean += std::pow(static_cast<double>((e + o) / 2 - whole.rays->ray(view, x, y)), 2);
        difference += std::pow(static_cast<double>(e - o), 2);
        ++n;
      }
  const double sigma = even.noise_sigma[3];
  EXPECT_LT(std::sqrt(mean / n), 0.1 * sigma);  // their means differ a little from view to view
  EXPECT_NEAR(std::sqrt(difference / n), std::sqrt(2.0) * sigma, 0.2 * sigma);
  EXPECT_DOUBLE_EQ(sigma, std::sqrt(2.0) * whole.noise_sigma[3]);
  EXPECT_EQ(even.mean_density, whole.mean_density);
}

TEST(HalvesOfTilts, AlternateInOrderOfTiltAndShareTheRays) {
  const FrameHalves frames;
  Measurement whole = prepared(frames.series());
  std::ranges::reverse(whole.geometry.tilt_deg);
  whole.held_out = {3};
  const Measurement even = half_of_tilts(Half::kEven, whole),
                    odd = half_of_tilts(Half::kOdd, whole);
  // In order of tilt: 11, 10, 9, 8, 7, 6, 5, 4, 2, 1, 0.
  EXPECT_EQ(odd.fitted_views(), (std::vector<int>{0, 2, 5, 7, 9, 11}));
  EXPECT_EQ(even.fitted_views(), (std::vector<int>{1, 4, 6, 8, 10}));
  EXPECT_EQ(even.left_out, odd.fitted_views());
  EXPECT_EQ(even.rays, whole.rays);
  EXPECT_EQ(even.noise_sigma, whole.noise_sigma);
}

TEST(HalvesOfFrames, ViewsHaveLessWeightAndLargerResiduals) {
  const auto models = with_noise_of_half_frames({{1.1, 0.3, 4.0, 2.0}});
  EXPECT_EQ(models[0].scale, 1.1);
  EXPECT_EQ(models[0].offset, 0.3);
  EXPECT_NEAR(models[0].weight, 2.0, 1e-12);
  EXPECT_NEAR(models[0].largest_residual, std::sqrt(8.0), 1e-12);
}

}  // namespace
}  // namespace tomofield::measurement
