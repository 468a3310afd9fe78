#include "tilt_series/tilt_series.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "expect_parts.h"
#include "io/images/mrc.h"
#include "loaded_view.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tomofield/error.h"
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

TEST(TiltSeries, AlignedStackIsReadAsItIs) {
  const ScratchDirectory scratch;
  const TiltSeries series(small_series(scratch));
  ASSERT_EQ(series.views().size(), 3u);
  EXPECT_EQ(series.width(), 16);
  EXPECT_EQ(series.height(), 12);
  EXPECT_NEAR(series.pixel_size_A(), 2.5, 1e-6);
  EXPECT_EQ(series.views()[2].tilt_deg, 0.0);
  EXPECT_EQ(series.noise_sigma().size(), 3u);
  const LoadedView view = load(series, 1);
  for (std::int64_t i = 0; i < 16 * 12; ++i) {
    ASSERT_EQ(view.image[static_cast<std::size_t>(i)], some_value(i % 16, i / 16, 1));
    ASSERT_EQ(view.valid[static_cast<std::size_t>(i)], 1);
  }
}

TEST(TiltSeries, ExcludedViewsAreAbsent) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 5);
  options.exclude = "1-2,4";
  const TiltSeries series(options);
  ASSERT_EQ(series.views().size(), 2u);
  EXPECT_EQ(series.views()[0].section, 2);
  EXPECT_EQ(series.views()[1].section, 4);
  EXPECT_EQ(series.views()[1].tilt_deg, 20.0);
  EXPECT_EQ(load(series, 1).image[0], some_value(0, 0, 4));
  options.exclude = "1-5";
  expect_parts(refusal(options), {"no section", "a.st"});
  options.exclude = "6";
  expect_parts(refusal(options), {"'6'", "1 to 5"});
}

TEST(TiltSeries, AnglesComeFromTheFirstSourceThereIs) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 2);
  options.aln = scratch.write("a.aln", "0 0 1 0 0 0 0 0 0 11\n1 0 1 0 0 0 0 0 0 12\n");
  options.mdoc = scratch.write(
      "a.mdoc", "PixelSpacing = 9\n[ZValue = 0]\nTiltAngle = 21\n[ZValue = 1]\nTiltAngle = 22\n");
  EXPECT_EQ(TiltSeries(options).views()[1].tilt_deg, -10.0);
  EXPECT_NEAR(TiltSeries(options).pixel_size_A(), 2.5, 1e-6);  // the header's
  options.tlt.reset();
  EXPECT_EQ(TiltSeries(options).views()[1].tilt_deg, 12.0);
  options.aln.reset();
  EXPECT_EQ(TiltSeries(options).views()[1].tilt_deg, 22.0);
  options.mdoc.reset();
  expect_parts(refusal(options), {"--tlt", "--aln", "--mdoc"});
}

TEST(TiltSeries, AnglesOfTheExtendedHeader) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 2);
  std::string bytes = testing::read_whole_file(options.stack);
  const std::int16_t tilts[] = {-3000, 125};
  const std::int32_t extended_bytes = 4;
  const std::int16_t layout[] = {2, 1};
  bytes.replace(92, 4, reinterpret_cast<const char*>(&extended_bytes), 4);
  bytes.replace(104, 4, "SERI");
  bytes.replace(128, 4, reinterpret_cast<const char*>(layout), 4);
  bytes.insert(1024, reinterpret_cast<const char*>(tilts), 4);
  scratch.write("a.st", bytes);
  EXPECT_EQ(TiltSeries(options).views()[1].tilt_deg, -10.0);  // the explicit file wins
  options.tlt.reset();
  EXPECT_EQ(TiltSeries(options).views()[0].tilt_deg, -30.0);
  EXPECT_EQ(TiltSeries(options).views()[1].tilt_deg, 1.25);
}

TEST(TiltSeries, CountsThatDifferNameBothFiles) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  options.tlt = scratch.write("b.tlt", "1\n2\n");
  expect_parts(refusal(options), {"b.tlt", "2 angles", "a.st", "3 sections"});
  options = small_series(scratch);
  options.xf = scratch.write("b.xf", "1 0 0 1 0 0\n");
  expect_parts(refusal(options), {"b.xf", "1 transforms", "3 sections"});
  options = small_series(scratch);
  options.xtilt = scratch.write("b.xtilt", "0\n0\n0\n0\n");
  expect_parts(refusal(options), {"b.xtilt", "4 x-axis tilts", "3 sections"});
  options = small_series(scratch);
  options.tlt.reset();
  options.mdoc = scratch.write("b.mdoc", "[ZValue = 0]\nTiltAngle = 1\n");
  expect_parts(refusal(options), {"b.mdoc", "1 sections", "3 sections"});
  options.aln = scratch.write("b.aln", "0 0 1 0 0 0 0 0 0 11\n");
  expect_parts(refusal(options), {"b.aln", "1 aligned", "a.st", "3"});
}

TEST(TiltSeries, ImpossibleAnglesAreRefused) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  options.tlt = scratch.write("b.tlt", "1\n2\n80.5\n");
  expect_parts(refusal(options), {"b.tlt", "line 3", "80.5"});
  options.exclude = "3";
  EXPECT_EQ(refusal(options), "");
  options.tlt = scratch.write("b.tlt", "1\ntwo\n3\n");
  expect_parts(refusal(options), {"b.tlt", "line 2", "two"});
}

TEST(TiltSeries, OptionsThatExcludeEachOther) {
  const ScratchDirectory scratch;
  TiltSeriesOptions linear = small_series(scratch);
  linear.log_base = 5;
  expect_parts(refusal(linear), {"--log-base", "--log "});
  TiltSeriesOptions options = small_series(scratch);
  options.take_log = true;
  expect_parts(refusal(options), {"--log", "dark"});
  options = small_series(scratch);
  options.bin = 2;
  options.angpix = 5.0;
  expect_parts(refusal(options), {"--bin", "--angpix"});
  options.bin = 0.5;
  options.angpix.reset();
  expect_parts(refusal(options), {"--bin 0.5"});
  options.bin = 13;
  expect_parts(refusal(options), {"13", "16 × 12"});
  options.bin = 1;
  options.angpix = 2.0;
  expect_parts(refusal(options), {"--angpix 2", "2.5"});
}

TEST(TiltSeries, BinningKeepsExactPixelSizes) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  write_stack(options.stack, 24, 20, 3, some_value);
  options.pixel_size_A = 1.7;
  options.angpix = 4.0;
  const TiltSeries series(options);
  EXPECT_DOUBLE_EQ(series.bin_factor(), 4.0 / 1.7);
  EXPECT_DOUBLE_EQ(series.pixel_size_A(), 4.0);
  EXPECT_EQ(series.width(), 10);  // floor(24 / 2.353)
  EXPECT_EQ(series.height(), 8);  // floor(20 / 2.353)
  options.angpix.reset();
  options.bin = 2;
  const TiltSeries halved(options);
  const float mean =
      (some_value(2, 0, 0) + some_value(3, 0, 0) + some_value(2, 1, 0) + some_value(3, 1, 0)) /
      4.0f;
  EXPECT_FLOAT_EQ(load(halved, 0).image[1], mean);
}

TEST(TiltSeries, ViewsOfFewerThanEightPixelsAreRefused) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  for (const auto& [width, height] : {std::pair{32, 1}, {1, 32}, {7, 7}, {2, 2}}) {
    write_stack(options.stack, width, height, 3, some_value);
    expect_parts(testing::message_of<Error>([&] { PlannedSeries{options}; }),
                 {fmt::format("views of {} × {} pixels", width, height), "at least 8", "--bin"});
  }
  write_stack(options.stack, 16, 16, 3, some_value);
  options.bin = 2;
  EXPECT_EQ(PlannedSeries(options).aligned_width(), 8);
  options.bin = 16;  // a single pixel cannot differ from the others
  expect_parts(refusal(options), {"views of 1 × 1 pixels"});
}

TEST(TiltSeries, ASizeThatAHeaderHasRoundedIsTheSame) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  write_stack(options.stack, 24, 16, 3, some_value);
  for (const double stored_A : {1.34, 3.37}) {
    options.pixel_size_A = static_cast<double>(static_cast<float>(stored_A * 48) / 48.0f);
    for (const int bin : {1, 2}) {
      options.angpix = bin * stored_A;
      const TiltSeries series(options);
      EXPECT_EQ(series.bin_factor(), bin);
      EXPECT_EQ(series.width(), 24 / bin);
    }
  }
}

TEST(TiltSeries, PixelSizeOfTheMdocWhereTheHeaderHasNone) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 1);
  write_stack(options.stack, 16, 12, 1, some_value, 1.0);
  options.mdoc = scratch.write("a.mdoc", "[ZValue = 0]\nTiltAngle = 1\nPixelSpacing = 3.42\n");
  EXPECT_DOUBLE_EQ(TiltSeries(options).pixel_size_A(), 3.42);
  options.mdoc.reset();
  write_stack(options.stack, 16, 12, 1, some_value, 0.0);
  const WarningCatcher warnings;
  EXPECT_DOUBLE_EQ(TiltSeries(options).pixel_size_A(), 1.0);
  expect_parts(warnings.text(), {"no pixel size", "--pixel-size"});
  write_stack(options.stack, 16, 12, 1, some_value, 1.0);
  const WarningCatcher of_one;
  EXPECT_DOUBLE_EQ(TiltSeries(options).pixel_size_A(), 1.0);
  expect_parts(of_one.text(), {"states pixels of 1 Å", "--pixel-size"});
  write_stack(options.stack, 16, 12, 1, some_value, 1.35 / 16);  // a cell of one pixel's size
  const WarningCatcher of_cell;
  EXPECT_DOUBLE_EQ(TiltSeries(options).pixel_size_A(), static_cast<double>(1.35f) / 16);
  expect_parts(of_cell.text(), {"a cell of 1.35 Å", "--pixel-size 1.35"});
}

TEST(TiltSeries, AnMdocOfAnotherSeriesIsSaid) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 2);
  options.mdoc = scratch.write("two.mdoc", "[ZValue = 0]\nTiltAngle = 1\n");
  const WarningCatcher warnings;
  TiltSeries{options};
  expect_parts(warnings.text(), {"two.mdoc", "1 sections", "2"});
  options.mdoc = scratch.write("no.mdoc", "-60.0\n-58.0\n");
  expect_parts(refusal(options), {"no.mdoc", "ZValue"});
}

TEST(TiltSeries, AnglesAreMovedByTheOffsetAndTheSpecimensTilt) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  options.xtilt = scratch.write("a.xtilt", "0.5\n0.5\n0.5\n");
  options.tilt_offset_deg = 1.25;
  options.x_axis_tilt_deg = 2;
  const TiltSeries series(options);
  EXPECT_EQ(series.views()[0].tilt_deg, -18.75);
  EXPECT_EQ(series.views()[2].tilt_deg, 1.25);
  for (const View& view : series.views()) EXPECT_EQ(view.x_tilt_deg, -1.5);
  options.tilt_offset_deg = 85;
  expect_parts(refusal(options), {"85", "section 3"});
}

TEST(TiltSeries, ARawStackMustBeAlignedIfTheMdocSaysSo) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  const auto with_axis = [&](const std::string& axis) {
    options.mdoc = scratch.write("a.mdoc", "[T = Tilt axis angle = " + axis +
                                               ", binning = 1]\n[ZValue = 0]\n[ZValue = 1]\n"
                                               "[ZValue = 2]\n");
    return refusal(options);
  };
  expect_parts(with_axis("85.9"),
               {"a.mdoc", "line 1", "85.9", "a.st", "--xf", "--aln", "--ignore"});
  expect_parts(with_axis("-1.5"), {"-1.5"});
  expect_parts(with_axis("-179.2"), {"-179.2"});  // the tilts go the other way
  for (const char* vertical : {"0.9", "-0.4", "359.5"}) EXPECT_EQ(with_axis(vertical), "");
  options.ignore = "LOG, tiltaxisangle";
  EXPECT_EQ(with_axis("85.9"), "");
  options.ignore = "";
  options.xf = scratch.write("a.xf", "1 0 0 1 0 0\n1 0 0 1 0 0\n1 0 0 1 0 0\n");
  EXPECT_EQ(with_axis("85.9"), "");
}

TEST(TiltSeries, ViewsMayLieInOneFileEach) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  const LoadedView expected = load(TiltSeries(options), 1);
  const auto view = [&](int section) {
    return [section](std::int64_t x, std::int64_t y, std::int64_t) {
      return some_value(x, y, section);
    };
  };
  std::filesystem::create_directory(scratch / "views");
  write_stack(scratch / "views" / "a_1.mrc", 16, 12, 1, view(0));
  write_stack(scratch / "views" / "a_10.mrc", 16, 12, 1, view(1));
  write_stack(scratch / "views" / "a_2_DW.mrc", 16, 12, 1, view(2));
  options.mdoc = scratch.write("a.mdoc",
                               "[ZValue = 0]\nSubFramePath = D:\\f\\a_1.eer\n[ZValue = 1]\n"
                               "SubFramePath = a_10.eer\n[ZValue = 2]\nSubFramePath = a_2.eer\n");
  options.stack = scratch / "views";
  EXPECT_EQ(load(TiltSeries(options), 1).image, expected.image);

  write_stack(scratch / "views" / "a_2_EVN.mrc", 16, 12, 1, view(2));
  expect_parts(refusal(options), {"a.mdoc", "ZValue = 2", "a_2_DW.mrc", "a_2_EVN.mrc"});
  write_stack(scratch / "views" / "a_2.mrc", 16, 12, 2, view(2));
  expect_parts(refusal(options), {"a_2.mrc", "2 images"});
  write_stack(scratch / "views" / "a_2.mrc", 16, 13, 1, view(2));
  expect_parts(refusal(options), {"a_2.mrc", "16 × 13", "16 × 12"});
  std::filesystem::remove(scratch / "views" / "a_1.mrc");
  expect_parts(refusal(options), {"a.mdoc", "ZValue = 0", "a_1"});
}

TEST(TiltSeries, OtherFilesOfASeriesAreNamed) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  for (const std::string name :
       {"a.tlt", "b.rawtlt", "c.xf", "d.xtilt", "e.aln", "f.com", "g.toml"}) {
    options.stack = scratch.write(name, "1 2 3\n");
    expect_parts(refusal(options), {name, "not a stack"});
  }
  for (const std::string name : {"h.star", "i.tomostar", "j.xml"}) {  // may list images
    options.stack = scratch.write(name, "1 2 3\n");
    expect_parts(refusal(options), {name});
  }
}

TEST(TiltSeries, AStackOfVolumesIsNone) {
  const ScratchDirectory scratch;
  io::MrcSpec spec;
  spec.nx = spec.ny = spec.sections_a_volume = 8;
  spec.nz = 24;
  TiltSeriesOptions options = small_series(scratch);
  options.stack = scratch / "particles.mrc";
  io::MrcWriter writer(options.stack, spec);
  for (int z = 0; z < spec.nz; ++z) writer.write_section(z, std::vector<float>(64, 1.0f));
  writer.close();
  expect_parts(refusal(options), {"particles.mrc", "stack of volumes", "401"});
}

TEST(TiltSeries, FewPixelsThatAreNoNumbersAreMasked) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  int num_bad = 1;
  const auto write = [&] {
    write_stack(options.stack, 16, 12, 3, [&](auto x, auto y, auto z) {
      const bool is_bad = z == 1 && y == 5 && x < num_bad;
      return is_bad ? (x == 0 ? std::numeric_limits<float>::quiet_NaN()
                              : std::numeric_limits<float>::infinity())
                    : some_value(x, y, z);
    });
  };
  write();
  {
    const WarningCatcher warnings;
    const TiltSeries series(options);
    expect_parts(warnings.text(), {"section 2", "1 NaN"});
    const LoadedView view = load(series, 1);
    EXPECT_EQ(view.valid[5 * 16], 0);
    EXPECT_EQ(view.image[5 * 16], 0.0f);
    EXPECT_EQ(view.valid[5 * 16 + 1], 1);
  }
  num_bad = 2;  // of 192: above one in a hundred
  write();
  expect_parts(refusal(options), {"section 2", "2 NaN or infinite", "--exclude 2"});
  options.exclude = "2";
  EXPECT_EQ(refusal(options), "");
}

TEST(TiltSeries, ConstantViewIsNamed) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  write_stack(options.stack, 16, 12, 3,
              [](auto x, auto y, auto z) { return z == 2 ? 7.0f : some_value(x, y, z); });
  expect_parts(refusal(options), {"section 3", "constant", "a.st"});
}

TEST(PlannedSeries, KnowsItsGeometryWithoutViews) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  write_stack(options.stack, 16, 12, 3, [](auto, auto, auto) { return 7.0f; });
  const PlannedSeries series(options);  // the views are constant, which is not seen
  EXPECT_EQ(series.views().size(), 3u);
  EXPECT_EQ(series.width(), 16);
  EXPECT_EQ(decode_view(series, 1).valid[100], 1);
  write_stack(options.stack, 16, 12, 4, [](auto, auto, auto) { return 7.0f; });
  EXPECT_THROW(PlannedSeries{options}, Error) << "of four sections and three angles";
}

// Transmission images I0 exp(−integral): a bright field with a dark disc.
constexpr float kEmptyBeam = 800.0f;
float integral_at(std::int64_t x, std::int64_t y) {
  const double r = std::hypot(static_cast<double>(x) - 31.5, static_cast<double>(y) - 31.5);
  return r < 15 ? 0.7f : 0.0f;
}

TEST(TiltSeries, DarkContrastBecomesLineIntegrals) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 2);
  base::Random random(3);
  write_stack(options.stack, 64, 64, 2, [&](auto x, auto y, auto) {
    return kEmptyBeam * std::exp(-integral_at(x, y)) + static_cast<float>(5.0 * random.normal());
  });
  options.contrast = Contrast::kDark;
  const TiltSeries linear(options);
  EXPECT_NEAR(linear.empty_beam(), kEmptyBeam, 10.0);
  EXPECT_NEAR(linear.noise_sigma()[0], 5.0, 0.5);
  const double depth = kEmptyBeam * (1.0 - std::exp(-0.7));
  const std::size_t centre = 32 * 64 + 32;
  EXPECT_NEAR(load(linear, 0).image[centre], depth, 30.0);

  options.take_log = true;
  const TiltSeries logarithm(options);
  EXPECT_NEAR(load(logarithm, 0).image[centre], 0.7, 0.06);
  EXPECT_NEAR(load(logarithm, 0).image[0], 0.0, 0.05);
  EXPECT_NEAR(logarithm.noise_sigma()[0], 5.0 / kEmptyBeam, 0.3 * 5.0 / kEmptyBeam);
}

// Noise, beads and hot pixels need every pixel of every view.
TEST(TiltSeries, IsTheSameOnAnyNumberOfThreads) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 9);
  write_stack(options.stack, 64, 64, 9, [](auto x, auto y, auto z) {
    base::Random random(static_cast<std::uint64_t>(z), static_cast<std::uint64_t>(y * 64 + x));
    const bool is_bead = std::hypot(x - 20 - z, y - 30) < 3;
    return kEmptyBeam - (is_bead ? 300.0f : 0.0f) + 5.0f * static_cast<float>(random.normal());
  });
  options.contrast = Contrast::kDark;
  options.bin = 1.5;
  for (const bool take_log : {false, true}) {
    options.take_log = take_log;
    base::set_thread_count(1);
    const TiltSeries on_one(options);
    base::set_thread_count(5);
    const TiltSeries on_five(options);
    base::set_thread_count(0);
    EXPECT_EQ(on_five.noise_sigma(), on_one.noise_sigma());
    EXPECT_EQ(on_five.empty_beam(), on_one.empty_beam());
    EXPECT_EQ(on_five.mask_metrics().num_bad_pixels, on_one.mask_metrics().num_bad_pixels);
    EXPECT_EQ(on_five.mask_metrics().beads_found, on_one.mask_metrics().beads_found);
    for (std::size_t view = 0; view < 9; ++view) {
      ASSERT_EQ(load(on_five, view).image, load(on_one, view).image);
      ASSERT_EQ(load(on_five, view).valid, load(on_one, view).valid);
    }
  }
}

TEST(TiltSeries, LogarithmIsThatOfIntensitiesWithTheBase) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 1);
  const auto intensities = [&](float base) {
    write_stack(options.stack, 32, 32, 1,
                [base](auto x, auto y, auto z) { return some_value(x, y, z) - base; });
    options.log_base = static_cast<double>(base);
    return load(TiltSeries(options), 0).image;
  };
  options.contrast = Contrast::kDark;
  options.take_log = true;
  const std::vector<float> expected = intensities(0), found = intensities(128);
  for (std::size_t i = 0; i < expected.size(); ++i) ASSERT_NEAR(found[i], expected[i], 1e-5);
}

TEST(TiltSeries, LogarithmNeverSeesZero) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 1);
  write_stack(options.stack, 64, 64, 1, [](auto x, auto y, auto) {
    if (x >= 10 && x < 13 && y < 3) return y == 0 ? 0.0f : -5.0f;  // too large for dead pixels
    return kEmptyBeam + static_cast<float>((x + y) % 3);
  });
  options.contrast = Contrast::kDark;
  options.take_log = true;
  const WarningCatcher warnings;
  const TiltSeries series(options);
  expect_parts(warnings.text(), {"9 pixels", "logarithm"});
  const LoadedView view = load(series, 0);
  for (std::size_t i = 0; i < view.image.size(); ++i) ASSERT_TRUE(std::isfinite(view.image[i]));
  EXPECT_NEAR(view.image[10], -std::log(1e-3), 1e-3);

  write_stack(options.stack, 64, 64, 1,
              [](auto x, auto y, auto z) { return -some_value(x, y, z); });
  expect_parts(refusal(options), {"--log", "positive"});
}

}  // namespace
}  // namespace tomofield::tilt_series
