#include "measurement/prepare.h"

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include "base/random.h"
#include "geometry/raw_from_aligned.h"
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

TEST(PrepareSeries, TheTiltAxisCountsInTheViewsBeforeBinningCutsTheirEdges) {
  SeriesFiles files;
  SpecimenOptions options = specimen();
  options.axis_x = 15.0;
  files.options().bin = 3;  // half a pixel is cut at either edge of 40
  const tilt_series::PlannedSeries series(files.options());
  ASSERT_EQ(series.aligned_width(), 13);
  const geometry::TiltGeometry g = plan_measurement(series, options).geometry;
  EXPECT_NEAR(3 * (g.axis_x - 13.0 / 2), 15.0 - kWidth / 2.0, 1e-9);
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

using geometry::RawFromAligned;
using geometry::ViewCorrection;

// A series whose views were recorded turned, shifted and a little magnified.
class RecordedSeries : public ::testing::Test {
 protected:
  RecordedSeries() {
    files_.options().mask = testing::write_stack(
        files_.scratch() / "block.mrc", kWidth, kHeight, kNumViews,
        [](auto x, auto y, auto) { return x > 8 && x < 15 && y > 20 && y < 28 ? 0.0f : 1.0f; });
    for (int view = 0; view < kNumViews; ++view) {
      const double angle = (6.0 + 0.3 * view) * std::numbers::pi / 180, scale = 1.0 + 0.002 * view;
      maps_.push_back({.m11 = scale * std::cos(angle),
                       .m12 = -scale * std::sin(angle),
                       .m21 = scale * std::sin(angle),
                       .m22 = scale * std::cos(angle),
                       .shift_x_px = 1.5 * view - 3.25,
                       .shift_y_px = 2.75 - view});
      corrections_.push_back({.shift_x_px = 0.4 * view - 1,
                              .shift_y_px = 0.7 - 0.3 * view,
                              .rotation_rad = 0.01 * view - 0.02,
                              .log_magnification = 0.004 * view,
                              .tilt_deg = 0.5 * view - 1});
    }
  }

  // Returns the series with an .xf file, and its views resampled or as they were recorded.
  tilt_series::TiltSeries series(std::span<const RawFromAligned> maps, bool resample) {
    std::string lines;
    for (const RawFromAligned& map : maps) {
      const io::ImodTransform t = geometry::invert(map);
      lines += fmt::format("{:.12f} {:.12f} {:.12f} {:.12f} {:.9f} {:.9f}\n", t.a11, t.a12, t.a21,
                           t.a22, t.shift_x_px, t.shift_y_px);
    }
    files_.options().xf = files_.scratch().write("series.xf", lines);
    files_.options().resample = resample;
    return tilt_series::TiltSeries(files_.options());
  }
  std::vector<RawFromAligned> corrected_maps() const {
    std::vector<RawFromAligned> maps;
    for (std::size_t view = 0; view < maps_.size(); ++view)
      maps.push_back(geometry::corrected(maps_[view], corrections_[view]));
    return maps;
  }
  Measurement realigned(std::span<const ViewCorrection> corrections) {
    const auto& processes = distributed::Communicator::alone();
    const tilt_series::TiltSeries recorded = series(maps_, false);
    Measurement prepared = plan_realigned(recorded, specimen(), processes);
    realign(recorded, corrections, 1, scratch(), kHeight, processes, prepared);
    return prepared;
  }
  Measurement resampled(std::span<const RawFromAligned> maps) {
    return prepare_measurement(series(maps, true), specimen(), scratch());
  }
  const std::filesystem::path& scratch() const { return files_.scratch().path(); }

  SeriesFiles files_;
  std::vector<RawFromAligned> maps_;
  std::vector<ViewCorrection> corrections_;
};

// Expects the same rays but for rounding, in the units of the series.
void expect_same_rays(const Measurement& found, const Measurement& expected) {
  ASSERT_EQ(found.rays->shape().width, kWidth);
  ASSERT_EQ(found.rays->shape().num_rows, kHeight);
  std::int64_t num_valid = 0, num_different_masks = 0;
  for (int view = 0; view < kNumViews; ++view) {
    for (std::int64_t y = 0; y < kHeight; ++y) {
      for (std::int64_t x = 0; x < kWidth; ++x) {
        const bool counts = found.rays->counts(view, x, y);
        num_different_masks += counts != expected.rays->counts(view, x, y) ? 1 : 0;
        if (!counts || !expected.rays->counts(view, x, y)) continue;
        ++num_valid;
        ASSERT_NEAR(found.rays->ray(view, x, y) * found.unit,
                    expected.rays->ray(view, x, y) * expected.unit, 1e-3)
            << view << ", " << x << ", " << y;
      }
    }
  }
  EXPECT_GT(num_valid, 1000);
  EXPECT_LE(num_different_masks, 3);  // the outermost pixels may round apart
}

TEST_F(RecordedSeries, HasTheRaysOfTheResampledOne) {
  const Measurement found = realigned(std::vector<ViewCorrection>(kNumViews));
  const Measurement expected = resampled(maps_);
  expect_same_rays(found, expected);
  EXPECT_FALSE(found.ray_geometry.has_value());
  EXPECT_EQ(found.geometry.tilt_deg, expected.geometry.tilt_deg);
  // Noise is measured before views are resampled, which smooths it.
  EXPECT_NEAR(found.unit, expected.unit, 0.01 * expected.unit);
  EXPECT_NEAR(found.mean_density * found.unit, expected.mean_density * expected.unit, 1e-6);
}

TEST_F(RecordedSeries, ACorrectionIsThatOfItsAlignment) {
  const Measurement found = realigned(corrections_);
  expect_same_rays(found, resampled(corrected_maps()));
  for (std::size_t view = 0; view < kNumViews; ++view)
    EXPECT_NEAR(found.geometry.tilt_deg[view],
                20.0 * static_cast<double>(view) - 60 + corrections_[view].tilt_deg, 1e-12);
}

TEST_F(RecordedSeries, LocalMotionIsUndoneAsInAResampledSeries) {
  for (ViewCorrection& correction : corrections_) {
    correction.local = {.width_px = kWidth, .height_px = kHeight};
    correction.local->nodes[7] = {2.0, -1.5};
    correction.local->nodes[16] = {-1.0, 0.5};
  }
  files_.options().corrections = corrections_;
  const Measurement expected = resampled(maps_);
  files_.options().corrections.clear();
  const Measurement found = realigned(corrections_);
  expect_same_rays(found, expected);
  for (ViewCorrection& correction : corrections_) correction.local.reset();
  const Measurement without = realigned(corrections_);
  double most = 0.0;
  for (std::int64_t x = 12; x < kWidth - 12; ++x)
    most = std::max(most, std::abs(static_cast<double>(found.rays->ray(3, x, kHeight / 3)) -
                                   static_cast<double>(without.rays->ray(3, x, kHeight / 3))));
  EXPECT_GT(most * found.unit, 0.1) << "the motion matters";
}

TEST_F(RecordedSeries, RealigningGivesTheSameRaysAsPreparingSo) {
  Measurement found = realigned(std::vector<ViewCorrection>(kNumViews));
  const double unit = found.unit;
  realign(series(maps_, false), corrections_, 1, scratch(), kHeight,
          distributed::Communicator::alone(), found);
  EXPECT_EQ(found.unit, unit);
  const Measurement expected = realigned(corrections_);
  expect_same_rays(found, expected);
  EXPECT_EQ(found.geometry.tilt_deg, expected.geometry.tilt_deg);
}

TEST_F(RecordedSeries, RealigningForWidePixelsGivesNearlyTheirMeans) {
  Measurement found = realigned(std::vector<ViewCorrection>(kNumViews));
  const Measurement exact = realigned(corrections_);
  for (const int bin : {2, 4}) {
    const Measurement expected = binned(exact, bin);
    realign(series(maps_, false), corrections_, bin, scratch(), kHeight,
            distributed::Communicator::alone(), found);
    EXPECT_EQ(found.rays->shape().width, (kWidth + bin - 1) / bin);
    EXPECT_EQ(found.geometry.width, kWidth);
    const Measurement coarse = binned(found, bin);
    EXPECT_EQ(coarse.rays, found.rays);
    EXPECT_EQ(coarse.geometry.width, expected.geometry.width);
    ASSERT_EQ(binned(found, 4).rays->shape().num_rows, (kHeight + 3) / 4);
    double difference = 0, squares = 0, sum = 0;
    int num_valid = 0, num_different_masks = 0;
    for (int view = 0; view < kNumViews; ++view)
      for (std::int64_t y = 0; y < expected.rays->shape().num_rows; ++y)
        for (std::int64_t x = 0; x < expected.rays->shape().width; ++x) {
          const bool counts = expected.rays->counts(view, x, y);
          num_different_masks += counts != coarse.rays->counts(view, x, y) ? 1 : 0;
          if (!counts || !coarse.rays->counts(view, x, y)) continue;
          const double value = static_cast<double>(expected.rays->ray(view, x, y));
          ++num_valid;
          difference += std::pow(static_cast<double>(coarse.rays->ray(view, x, y)) - value, 2);
          squares += value * value;
          sum += value;
        }
    const double variance = squares - sum * sum / num_valid;
    EXPECT_GT(num_valid, 0.5 * kNumViews * kWidth * kHeight / (bin * bin)) << bin;
    EXPECT_LT(num_different_masks, 0.05 * num_valid) << bin;
    EXPECT_LT(difference, 0.01 * variance) << bin;
  }
}

}  // namespace
}  // namespace tomofield::measurement
