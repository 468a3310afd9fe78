#include "measurement/prepare.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "base/random.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

constexpr std::int64_t kWidth = 40, kHeight = 36;
constexpr int kNumViews = 7;
constexpr double kThickness = 20;

// Writes the files of a small series and opens them.
class SeriesFiles {
 public:
  SeriesFiles() {
    options_.contrast = Contrast::kBright;
    options_.stack = write_views("series.mrc", 1.0);
    std::string tilts;
    for (int view = 0; view < kNumViews; ++view) tilts += std::to_string(20 * view - 60) + "\n";
    options_.tlt = scratch_.write("series.tlt", tilts);
  }

  // Writes views of soft waves with noise, times a scale.
  std::filesystem::path write_views(const std::string& name, double scale) const {
    base::Random random(3);
    return testing::write_stack(
        scratch_ / name, kWidth, kHeight, kNumViews,
        [&](std::int64_t x, std::int64_t y, std::int64_t view) {
          const double wave =
              std::sin(static_cast<double>(x + view) / 5) + std::cos(static_cast<double>(y) / 7);
          return static_cast<float>(scale * (50 + 4 * wave + 0.5 * random.normal()));
        });
  }

  // Writes a mask that leaves out every ninth pixel.
  std::filesystem::path write_mask() const {
    return testing::write_stack(scratch_ / "mask.mrc", kWidth, kHeight, kNumViews,
                                [](std::int64_t x, std::int64_t y, std::int64_t view) {
                                  return is_masked(x, y, view) ? 0.0f : 1.0f;
                                });
  }

  static bool is_masked(std::int64_t x, std::int64_t y, std::int64_t view) {
    return (x + 3 * y + view) % 9 == 0;
  }

  Measurement prepared(const SpecimenOptions& specimen) const {
    return prepare_measurement(tilt_series::TiltSeries(options_), specimen, scratch_.path());
  }

  tilt_series::TiltSeriesOptions& options() { return options_; }
  const testing::ScratchDirectory& scratch() const { return scratch_; }

 private:
  testing::ScratchDirectory scratch_;
  tilt_series::TiltSeriesOptions options_;
};

SpecimenOptions specimen() {
  SpecimenOptions options;
  options.thickness = kThickness;
  return options;
}

TEST(PrepareSeries, RaysAreTheViewsOverTheUnitAndMaskedPixelsCarryNoLoss) {
  SeriesFiles files;
  files.options().mask = files.write_mask();
  const tilt_series::TiltSeries series(files.options());
  const Measurement prepared = files.prepared(specimen());
  ASSERT_GT(prepared.unit, 0.0);
  std::vector<float> image(static_cast<std::size_t>(kWidth * kHeight));
  std::vector<std::uint8_t> valid(image.size());
  for (int view = 0; view < kNumViews; ++view) {
    const auto v = static_cast<std::size_t>(view);
    series.read_view(v, image, valid);
    std::int64_t num_masked = 0;
    for (std::int64_t i = 0; i < kWidth * kHeight; ++i) {
      const bool is_valid = valid[static_cast<std::size_t>(i)] != 0;
      ASSERT_FALSE(is_valid && SeriesFiles::is_masked(i % kWidth, i / kWidth, view));
      ASSERT_EQ(prepared.rays->counts(view, i % kWidth, i / kWidth), is_valid) << view << ", " << i;
      num_masked += is_valid ? 0 : 1;
      if (!is_valid) continue;
      const double expected =
          static_cast<double>(image[static_cast<std::size_t>(i)]) / prepared.unit;
      ASSERT_NEAR(prepared.rays->ray(view, i % kWidth, i / kWidth), expected, 1e-5 * expected);
    }
    EXPECT_NEAR(prepared.masked_part[v],
                static_cast<double>(num_masked) / static_cast<double>(kWidth * kHeight), 1e-12);
    EXPECT_NEAR(prepared.noise_sigma[v] * prepared.unit, series.noise_sigma()[v], 1e-12);
  }
}

TEST(PrepareSeries, TheUnitOfTheDataDoesNotMatter) {
  SeriesFiles files;
  const Measurement one = files.prepared(specimen());
  files.options().stack = files.write_views("doubled.mrc", 2.0);
  const Measurement two = files.prepared(specimen());
  EXPECT_NEAR(two.unit / one.unit, 2.0, 1e-6);
  EXPECT_NEAR(two.mean_density, one.mean_density, 1e-6 * one.mean_density);
  for (int view = 0; view < kNumViews; ++view) {
    const auto v = static_cast<std::size_t>(view);
    EXPECT_NEAR(two.noise_sigma[v], one.noise_sigma[v], 1e-6 * one.noise_sigma[v]);
    EXPECT_NEAR(two.rays->ray(view, 11, 17), one.rays->ray(view, 11, 17), 1e-3);
  }
}

TEST(PrepareSeries, AThickerSpecimenOfTheSameMeanIsThinner) {
  const SeriesFiles files;
  SpecimenOptions thick = specimen();
  thick.thickness = 2 * kThickness;
  const Measurement one = files.prepared(specimen()), two = files.prepared(thick);
  // A density unit is a contrast for each pixel of thickness, so the rays grow with the thickness.
  EXPECT_NEAR(two.unit, one.unit / 2, 1e-9);
  EXPECT_NEAR(two.mean_density, one.mean_density, 1e-9);
}

TEST(PrepareSeries, ARegionOfInterestHasItsRowsAlone) {
  const SeriesFiles files;
  SpecimenOptions part = specimen();
  part.roi = Rectangle{4, 5, 30, 29};
  const Measurement prepared = files.prepared(part);
  EXPECT_EQ(prepared.rays->shape().first_row, 5);
  EXPECT_EQ(prepared.rays->shape().num_rows, 24);
  const Measurement whole = files.prepared(specimen());
  for (const std::int64_t x : {0, 21, 39}) {  // rays outside the region see it in tilted views
    EXPECT_NEAR(prepared.rays->ray(2, x, 3) * prepared.unit, whole.rays->ray(2, x, 8) * whole.unit,
                1e-3);
  }
}

TEST(PrepareSeries, BinnedViewsHaveABinnedGeometry) {
  SeriesFiles files;
  files.options().bin = 2;
  SpecimenOptions options = specimen();
  options.axis_x = 15.0;
  options.shift_z = 6.0;
  options.roi = Rectangle{4, 6, 30, 28};
  const Measurement prepared = files.prepared(options);
  EXPECT_EQ(prepared.geometry.width, kWidth / 2);
  EXPECT_EQ(prepared.geometry.height, kHeight / 2);
  EXPECT_EQ(prepared.geometry.thickness, kThickness / 2);
  EXPECT_EQ(prepared.geometry.axis_x, 7.5);
  EXPECT_EQ(prepared.geometry.axis_z, prepared.geometry.thickness / 2 + 3);
  EXPECT_EQ(prepared.roi.x0, 2);
  EXPECT_EQ(prepared.roi.y1, 14);
  EXPECT_NEAR(prepared.pixel_size_A, 5.0, 1e-6);
}

TEST(PrepareSeries, OptionsThatDoNotFitTheSeriesAreRefused) {
  SeriesFiles files;
  const auto complaint = [&](const SpecimenOptions& options) {
    return testing::message_of<Error>(
        [&] { plan_measurement(tilt_series::TiltSeries(files.options()), options); });
  };
  EXPECT_EQ(complaint(specimen()), "");
  SpecimenOptions options = specimen();
  options.thickness = 0;
  EXPECT_NE(complaint(options).find("--thickness"), std::string::npos) << complaint(options);
  options = specimen();
  options.hand = 2;
  EXPECT_NE(complaint(options).find("--hand"), std::string::npos) << complaint(options);
  options = specimen();
  options.roi = Rectangle{4, 5, 41, 29};
  EXPECT_NE(complaint(options).find("--roi"), std::string::npos) << complaint(options);
  options = specimen();
  options.axis_x = 500;
  EXPECT_NE(complaint(options).find("--center"), std::string::npos) << complaint(options);
  files.options().xtilt = files.scratch().write("series.xtilt", "0\n0\n0\n0\n0\n0\n9\n");
  EXPECT_NE(complaint(specimen()).find("--engine ray"), std::string::npos) << complaint(specimen());
}

}  // namespace
}  // namespace tomofield::measurement
