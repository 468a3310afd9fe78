#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numeric>

#include "bead_series.h"
#include "expect_parts.h"
#include "io/images/mrc.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/error.h"
#include "warning_catcher.h"

namespace tomofield::tilt_series {
namespace {

using testing::BeadScene;
using testing::message_of;
using testing::ScratchDirectory;
using testing::some_value;
using testing::write_stack;

constexpr std::int64_t kWidth = 64, kHeight = 48;
constexpr double kPixelSize = 4.0;

TiltSeriesOptions plain_series(const ScratchDirectory& scratch) {
  TiltSeriesOptions options;
  options.stack = write_stack(scratch / "a.st", kWidth, kHeight, 3, some_value, kPixelSize);
  options.tlt = scratch.write("a.tlt", "-10\n0\n10\n");
  options.contrast = Contrast::kBright;
  return options;
}

std::vector<std::uint8_t> valid_of(const TiltSeries& series, std::size_t view) {
  const auto pixels = static_cast<std::size_t>(series.width() * series.height());
  std::vector<float> image(pixels);
  std::vector<std::uint8_t> valid(pixels);
  series.read_view(view, image, valid);
  return valid;
}

/// Middle and radius of what is masked in a view (one disc of it).
struct Hole {
  double x = 0, y = 0, radius = 0;
};

Hole hole_of(const TiltSeries& series, std::size_t view) {
  const auto valid = valid_of(series, view);
  double n = 0;
  Hole hole;
  for (std::size_t i = 0; i < valid.size(); ++i) {
    if (valid[i]) continue;
    n += 1;
    hole.x += static_cast<double>(static_cast<std::int64_t>(i) % series.width()) + 0.5;
    hole.y += static_cast<double>(static_cast<std::int64_t>(i) / series.width()) + 0.5;
  }
  return {hole.x / n, hole.y / n, std::sqrt(n / std::numbers::pi)};
}

void expect_refusal(const TiltSeriesOptions& options, const std::vector<std::string>& parts) {
  const std::string message = message_of<Error>([&] { TiltSeries series(options); });
  for (const auto& part : parts) {
    EXPECT_NE(message.find(part), std::string::npos) << "'" << part << "' in: " << message;
  }
}

TEST(SeriesMasks, ZerosOfTheUsersMaskAreLeftOut) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = plain_series(scratch);
  options.mask = write_stack(
      scratch / "mask.mrc", kWidth, kHeight, 3,
      [](std::int64_t x, std::int64_t y, std::int64_t z) {
        return x + y < 20 + 5 * z ? 0.0f : (x % 2 ? 1.0f : -3.0f);
      },
      kPixelSize);
  options.exclude = "1";  // the mask has a section for this one too
  const TiltSeries series(options);
  for (std::size_t view = 0; view < 2; ++view) {
    const auto valid = valid_of(series, view);
    for (std::int64_t i = 0; i < kWidth * kHeight; ++i) {
      const bool counts = i % kWidth + i / kWidth >= 20 + 5 * static_cast<std::int64_t>(view + 1);
      ASSERT_EQ(valid[static_cast<std::size_t>(i)], counts ? 1 : 0) << view << " " << i;
    }
  }
}

TEST(SeriesMasks, AMaskOfAnotherSizeOrWithoutAMeasurementIsRefused) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = plain_series(scratch);
  options.mask = write_stack(
      scratch / "ones.mrc", kWidth, kHeight, 3, [](auto, auto, auto) { return 1e-6f; }, kPixelSize);
  const testing::WarningCatcher warnings;
  TiltSeries{options};
  testing::expect_parts(warnings.text(), {"ones.mrc", "has no pixel that is 0"});
  options.mask = write_stack(
      scratch / "inverted.mrc", kWidth, kHeight, 3,
      [](std::int64_t x, auto, auto) { return x < 6 ? 1.0f : 0.0f; }, kPixelSize);
  const testing::WarningCatcher of_inverted;
  TiltSeries{options};
  testing::expect_parts(of_inverted.text(), {"inverted.mrc", "leaves out 90.6 %"});
  options.mask = write_stack(scratch / "small.mrc", kWidth, kHeight, 2, some_value, kPixelSize);
  expect_refusal(options, {"small.mrc", "64 × 48 pixels and 2 sections", "a.st", "and 3"});
  options.mask = write_stack(
      scratch / "zero.mrc", kWidth, kHeight, 3,
      [](std::int64_t, std::int64_t, std::int64_t z) { return z == 1 ? 0.0f : 1.0f; }, kPixelSize);
  expect_refusal(options, {"section 2", "--mask", "--exclude 2"});
}

TEST(SeriesMasks, FiducialsAreMaskedWhereTheyAre) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = plain_series(scratch);
  options.fiducials = scratch.write("f.txt", "1 20.25 30.5 0.00\n1 40.5 11 2.00\n");
  options.bead_diameter_nm = 1.6;  // 4 pixels
  const TiltSeries series(options);
  EXPECT_EQ(series.mask_metrics().num_beads, 0u);
  EXPECT_EQ(series.mask_metrics().beads_masked, (std::vector<std::size_t>{1, 0, 1}));
  for (const auto& [view, x, y] : {std::tuple{0, 20.25, 30.5}, {2, 40.5, 11.0}}) {
    const Hole hole = hole_of(series, static_cast<std::size_t>(view));
    EXPECT_NEAR(hole.x, x, 0.3);
    EXPECT_NEAR(hole.y, y, 0.3);
    EXPECT_NEAR(hole.radius, 1.2 * 4, 0.4);
  }
}

TEST(SeriesMasks, FiducialsFollowAlignmentAndBinning) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options;
  // Bright 4 × 4 spots that the transforms must bring to where the fiducials' discs are.
  options.stack = write_stack(
      scratch / "a.st", kWidth, kHeight, 3,
      [](std::int64_t x, std::int64_t y, std::int64_t) {
        const bool is_spot = x >= 38 && x < 42 && y >= 16 && y < 20;
        return is_spot ? 900.0f : static_cast<float>((x * 7 + y * 13) % 31);
      },
      kPixelSize);
  options.tlt = scratch.write("a.tlt", "-10\n0\n10\n");
  options.contrast = Contrast::kBright;
  options.xf =
      scratch.write("a.xf", "1 0 0 1 3 -2\n0.9 0.2 -0.1 1.1 -4 5\n0.96 0.28 -0.28 0.96 0 0\n");
  options.bin = 2;
  options.fiducials = scratch.write("f.txt", "40 18 0\n40 18 1\n40 18 2\n");
  options.bead_diameter_nm = 2.4;  // 3 binned pixels
  TiltSeriesOptions without = options;
  without.fiducials.reset();
  const TiltSeries bare(without), masked(options);
  const auto pixels = static_cast<std::size_t>(bare.width() * bare.height());
  for (std::size_t view = 0; view < 3; ++view) {
    std::vector<float> image(pixels), hidden(pixels);
    std::vector<std::uint8_t> valid(pixels), holes(pixels);
    bare.read_view(view, image, valid);
    masked.read_view(view, hidden, holes);
    std::size_t num_hidden = 0;
    for (std::size_t i = 0; i < pixels; ++i) {
      const bool is_spot = image[i] > 200;
      EXPECT_FALSE(is_spot && holes[i]) << "pixel " << i << " of view " << view;
      num_hidden += valid[i] && !holes[i];
    }
    EXPECT_NEAR(static_cast<double>(num_hidden), std::numbers::pi * 3.6 * 3.6, 8);
  }
}

TEST(SeriesMasks, FiducialsThatDoNotFitAreRefused) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = plain_series(scratch);
  options.fiducials = scratch.write("f.txt", "20 30 0\n20 30 3\n");
  options.bead_diameter_nm = 1.6;
  expect_refusal(options, {"f.txt", "line 2", "section 3", "0 to 2"});
  options.fiducials = scratch.write("f.txt", "70 30 0\n");
  expect_refusal(options, {"line 1", "70, 30", "64 × 48"});
  options.fiducials = scratch.write("f.txt", "20 30 0\n");
  options.bead_diameter_nm = {};
  expect_refusal(options, {"f.txt", "--bead-diameter"});
}

TEST(SeriesMasks, ADiameterThatCannotBeFoundIsRefused) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = plain_series(scratch);
  for (const double diameter_nm : {0.4, 10.0}) {
    options.bead_diameter_nm = diameter_nm;
    expect_refusal(options, {"--bead-diameter", fmt::format("{:g} nm", diameter_nm), "4 Å",
                             fmt::format("{:g} pixels", diameter_nm * 2.5)});
  }
}

TEST(SeriesMasks, HotPixelsAreCountedAndLeftOut) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = plain_series(scratch);
  options.stack = write_stack(
      scratch / "hot.st", kWidth, kHeight, 3,
      [](std::int64_t x, std::int64_t y, std::int64_t z) {
        return x == 10 && y == 20 && z == 1 ? 1e5f : some_value(x, y, z);
      },
      kPixelSize);
  const TiltSeries series(options);
  EXPECT_EQ(series.mask_metrics().num_bad_pixels, 1);
  const auto valid = valid_of(series, 1);
  EXPECT_EQ(valid[20 * kWidth + 10], 0);
  EXPECT_EQ(std::count(valid.begin(), valid.end(), 0), 1);
}

/// The scene as a dark stack of 8 Å a pixel.
TiltSeriesOptions dark_series(const ScratchDirectory& scratch, const BeadScene& scene) {
  std::vector<MaskedImage> views;
  std::string tilts;
  for (std::size_t view = 0; view < scene.tilt_deg.size(); ++view) {
    views.push_back(scene.view(view));
    tilts += fmt::format("{}\n", scene.tilt_deg[view]);
  }
  TiltSeriesOptions options;
  options.stack = write_stack(
      scratch / "beads.st", scene.width, scene.height, static_cast<std::int64_t>(views.size()),
      [&](std::int64_t x, std::int64_t y, std::int64_t z) {
        const MaskedImage& view = views[static_cast<std::size_t>(z)];
        return 500 - view.values[view.index(x, y)];
      },
      kPixelSize);
  options.tlt = scratch.write("beads.tlt", tilts);
  options.pixel_size_A = 8.0;
  return options;
}

TEST(SeriesMasks, BeadsOfDarkSeriesAreMaskedUnlessTurnedOff) {
  const ScratchDirectory scratch;
  BeadScene scene;
  scene.scatter_beads(10, 2);
  TiltSeriesOptions options = dark_series(scratch, scene);
  const TiltSeries series(options);
  EXPECT_EQ(series.mask_metrics().num_beads, 10u);
  EXPECT_NEAR(series.mask_metrics().bead_diameter_A, 0.866 * 5 * 8, 6);
  const auto valid = valid_of(series, 15);
  for (const auto& bead : scene.beads) {
    const auto x = static_cast<std::size_t>(scene.bead_x(bead, 15));
    EXPECT_EQ(valid[static_cast<std::size_t>(bead.y_px) * 160 + x], 0);
  }
  const double masked = static_cast<double>(std::count(valid.begin(), valid.end(), 0));
  EXPECT_NEAR(masked, 10 * std::numbers::pi * std::pow(1.2 * 0.866 * 5, 2), 0.2 * masked);
  options.bead_diameter_nm = 0.0;
  const TiltSeries off(options);
  EXPECT_EQ(off.mask_metrics().num_beads, 0u);
  const auto all = valid_of(off, 15);
  EXPECT_EQ(std::count(all.begin(), all.end(), 0), 0);
}

TEST(SeriesMasks, BeadsOfBrightSeriesStayUndecidedUnlessAskedFor) {
  BeadScene scene;
  scene.scatter_beads(6, 2);
  TiltSeriesOptions options;
  options.images = scene.stack(Contrast::kBright);
  options.contrast = Contrast::kBright;
  const TiltSeries found(options);
  EXPECT_EQ(found.mask_metrics().num_beads, 6u);
  EXPECT_EQ(found.mask_metrics().bead_masking, BeadMasking::kUndecided);
  EXPECT_EQ(found.mask_metrics().beads_masked, std::vector<std::size_t>(31, 0));
  options.bead_diameter_nm = found.mask_metrics().bead_diameter_A / 10;
  const TiltSeries asked(options);
  EXPECT_EQ(asked.mask_metrics().num_beads, 6u);
  EXPECT_EQ(asked.mask_metrics().bead_masking, BeadMasking::kMasked);
  EXPECT_EQ(asked.noise_sigma(), found.noise_sigma()) << "neither sees the beads";
  const auto pixels = static_cast<std::size_t>(found.width() * found.height());
  std::vector<float> image(pixels);
  std::vector<std::uint8_t> valid(pixels);
  for (const std::size_t view : {0, 15, 22}) {
    ASSERT_FALSE(found.undecided_beads()[view].empty());
    found.read_view(view, image, valid);
    EXPECT_EQ(image, scene.view(view).values);
    const auto masked = valid_of(asked, view);
    for (std::size_t i = 0; i < pixels; ++i)
      ASSERT_EQ(valid[i], masked[i] == kNoMeasurement ? kUndecidedBead : kMeasurement);
  }
  options.bead_diameter_nm = 0.0;
  const TiltSeries off(options);
  EXPECT_EQ(off.mask_metrics().num_beads, 0u);
  EXPECT_EQ(off.mask_metrics().bead_masking, BeadMasking::kNone);
}

TEST(SeriesMasks, TheNoiseIsThatBesideTheBeads) {
  BeadScene scene;
  scene.specimen = 0;
  scene.diameter_px = 8;
  scene.contrast = 300;
  TiltSeriesOptions options;
  options.contrast = Contrast::kBright;
  const auto mean_noise = [&] {
    options.images = scene.stack(Contrast::kBright);
    const TiltSeries series(options);
    const std::vector<double>& sigma = series.noise_sigma();
    return std::reduce(sigma.begin(), sigma.end()) / static_cast<double>(sigma.size());
  };
  const double without_beads = mean_noise();
  scene.scatter_beads(8, 3);
  // Among the beads it would be 1.03 times as large.
  EXPECT_NEAR(mean_noise(), without_beads, 0.005);
}

}  // namespace
}  // namespace tomofield::tilt_series
