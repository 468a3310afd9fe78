#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "expect_parts.h"
#include "loaded_view.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tilt_series/tilt_series.h"
#include "warning_catcher.h"

namespace tomofield::tilt_series {
namespace {

using testing::expect_parts;
using testing::load;
using testing::LoadedView;
using testing::refusal;
using testing::ScratchDirectory;
using testing::small_series;
using testing::some_value;
using testing::WarningCatcher;
using testing::write_stack;

struct AlignmentCase {
  std::int64_t nx, ny;
  double rotation_deg;
  double shift_x_px, shift_y_px;  // raw − centre = R(rotation) q + shift
};

class TiltSeriesAlignment : public ::testing::TestWithParam<AlignmentCase> {
 protected:
  static constexpr double kBlobX = 7.3, kBlobY = -4.6;  // of the aligned image's centre
  static constexpr double kBlobRadius = 2.5;

  // A stack with a Gaussian where the aligned position (kBlobX, kBlobY) lands in the raw image.
  TiltSeriesOptions write_blob(const ScratchDirectory& scratch) const {
    const auto [nx, ny, rotation_deg, shift_x, shift_y] = GetParam();
    const double c = std::cos(rotation_deg * std::numbers::pi / 180);
    const double s = std::sin(rotation_deg * std::numbers::pi / 180);
    const double raw_x = c * kBlobX - s * kBlobY + shift_x + 0.5 * static_cast<double>(nx);
    const double raw_y = s * kBlobX + c * kBlobY + shift_y + 0.5 * static_cast<double>(ny);
    TiltSeriesOptions options;
    options.stack = write_stack(scratch / "raw.st", nx, ny, 1, [&](auto x, auto y, auto) {
      const double dx = static_cast<double>(x) + 0.5 - raw_x;
      const double dy = static_cast<double>(y) + 0.5 - raw_y;
      return static_cast<float>(100 *
                                std::exp(-(dx * dx + dy * dy) / (2 * kBlobRadius * kBlobRadius)));
    });
    options.contrast = Contrast::kBright;
    options.tlt = scratch.write("a.tlt", "0\n");
    // The file's own definition: A = R(−ROT), and A (raw − centre) + D = q.
    const double dx = -(c * shift_x + s * shift_y), dy = -(-s * shift_x + c * shift_y);
    options.xf = scratch.write(
        "raw.xf", fmt::format("{:.9f} {:.9f} {:.9f} {:.9f} {:.6f} {:.6f}\n", c, s, -s, c, dx, dy));
    scratch.write("raw.aln",
                  fmt::format("# RawSize = {} {} 1\n0 {:.9f} 1.0 {:.6f} {:.6f} 1 1 1 0 0\n", nx, ny,
                              rotation_deg, shift_x, shift_y));
    return options;
  }
};

TEST_P(TiltSeriesAlignment, BlobLandsWhereTheTransformSays) {
  const ScratchDirectory scratch;
  const TiltSeries series(write_blob(scratch));
  const bool is_swapped = std::fabs(std::sin(GetParam().rotation_deg * std::numbers::pi / 180)) >
                          std::numbers::sqrt2 / 2;
  EXPECT_EQ(series.width(), is_swapped ? GetParam().ny : GetParam().nx);
  EXPECT_EQ(series.height(), is_swapped ? GetParam().nx : GetParam().ny);
  const LoadedView view = load(series, 0);
  double sum = 0, sum_x = 0, sum_y = 0;
  for (std::size_t i = 0; i < view.image.size(); ++i) {
    const auto x = static_cast<double>(static_cast<std::int64_t>(i) % view.width);
    const auto y = static_cast<double>(static_cast<std::int64_t>(i) / view.width);
    sum += view.image[i];
    sum_x += view.image[i] * (x + 0.5 - 0.5 * static_cast<double>(series.width()));
    sum_y += view.image[i] * (y + 0.5 - 0.5 * static_cast<double>(series.height()));
  }
  EXPECT_NEAR(sum_x / sum, kBlobX, 0.02);
  EXPECT_NEAR(sum_y / sum, kBlobY, 0.02);
  EXPECT_NEAR(sum, 100 * 2 * std::numbers::pi * kBlobRadius * kBlobRadius, 20.0);
}

TEST_P(TiltSeriesAlignment, AreTomoAndImodAgree) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = write_blob(scratch);
  const LoadedView by_imod = load(TiltSeries(options), 0);
  options.xf.reset();
  options.aln = scratch / "raw.aln";
  const LoadedView by_aretomo = load(TiltSeries(options), 0);
  ASSERT_EQ(by_aretomo.image.size(), by_imod.image.size());
  for (std::size_t i = 0; i < by_imod.image.size(); ++i) {
    if (by_imod.valid[i] != by_aretomo.valid[i]) continue;  // the outermost pixels may round apart
    ASSERT_NEAR(by_aretomo.image[i], by_imod.image[i], 1e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Cases, TiltSeriesAlignment,
    ::testing::Values(AlignmentCase{64, 48, 0, 0, 0}, AlignmentCase{64, 48, 0, 3.25, -2.5},
                      AlignmentCase{61, 48, 12.5, 1.5, 2.25}, AlignmentCase{61, 49, -8, -2, 0.5},
                      AlignmentCase{64, 47, 85.3, 2.75, -1.5}, AlignmentCase{63, 50, -95, 0.25, 1},
                      AlignmentCase{64, 48, 178, 1, 1}));

TEST(TiltSeriesTransforms, PixelsWithoutDataAreInvalid) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 1);
  options.xf = scratch.write("a.xf", "1 0 0 1 3 -2\n");
  const LoadedView view = load(TiltSeries(options), 0);
  for (std::int64_t y = 0; y < 12; ++y) {
    for (std::int64_t x = 0; x < 16; ++x) {
      const auto at = static_cast<std::size_t>(16 * y + x);
      const bool is_inside = x >= 3 && y < 10;
      ASSERT_EQ(view.valid[at], is_inside);
      ASSERT_EQ(view.image[at], is_inside ? some_value(x - 3, y + 2, 0) : 0.0f);
    }
  }
  options.xf = scratch.write("a.xf", "1 0 0 1 100 0\n");
  expect_parts(refusal(options), {"section 1", "no pixel left"});
}

TEST(TiltSeriesTransforms, MagnificationIsUndone) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 1);
  write_stack(options.stack, 33, 33, 1,
              [](auto x, auto y, auto) { return static_cast<float>(x + 2 * y); });
  options.xf = scratch.write("a.xf", "1.25 0 0 1.25 0 0\n");
  const LoadedView view = load(TiltSeries(options), 0);
  // Eight pixels beside the centre came from 6.4 pixels beside it.
  EXPECT_NEAR(view.image[16 * 33 + 24], (16 + 6.4) + 2 * 16, 1e-3);
}

TEST(TiltSeriesTransforms, DarkFramesOfAreTomoAreLeftOut) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 4);
  options.tlt.reset();
  options.aln = scratch.write("a.aln",
                              "# RawSize = 16 12 4\n# DarkFrame = 1 1 -10.0\n"
                              "0 0 1 0 0 0 0 0 0 -20\n1 0 1 0 0 0 0 0 0 0\n2 0 1 0 0 0 0 0 0 10\n");
  const TiltSeries series(options);
  ASSERT_EQ(series.views().size(), 3u);
  EXPECT_EQ(series.views()[1].section, 2);
  EXPECT_EQ(series.views()[1].tilt_deg, 0.0);
  options.aln = scratch.write("a.aln", "# RawSize = 32 24 4\n0 0 1 0 0 0 0 0 0 -20\n");
  expect_parts(refusal(options), {"32 × 24", "16 × 12"});
}

TEST(TiltSeriesTransforms, AViewThatIsTurnedAgainstTheOthersIsSaid) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 4);
  const auto warnings = [&](const std::string& last) {
    options.xf = scratch.write("a.xf", "1 0 0 1 0 0\n1 0 0 1 0 0\n1 0 0 1 0 0\n" + last + "\n");
    const WarningCatcher caught;
    const TiltSeries series(options);
    return caught.text();
  };
  EXPECT_EQ(warnings("0.97 0.24 -0.24 0.97 0 0"), "");
  expect_parts(warnings("0 1 -1 0 0 0"), {"a.xf", "1 of 4 views", "section 4", "90.0°"});
}

}  // namespace
}  // namespace tomofield::tilt_series
