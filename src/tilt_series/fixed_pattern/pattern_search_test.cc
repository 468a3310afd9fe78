#include "tilt_series/fixed_pattern/pattern_search.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "io/images/image_stack.h"
#include "scratch_directory.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kWidth = 128, kHeight = 96;
constexpr int kViews = 25;
constexpr double kNoise = 1.0;

double tilt_deg(int view) { return 5.0 * (view - kViews / 2); }

/// Returns what the detector adds to a pixel of a view.
using Detector = std::function<double(std::int64_t x, std::int64_t y, int view)>;
double nothing(std::int64_t, std::int64_t, int) { return 0.0; }

/// A specimen of soft round bodies, and where the stage has it in y.
struct Scene {
  std::function<double(int view)> shift_y_px = [](int) { return 0.0; };
  bool has_rod = false;  ///< along the tilt axis, which is vertical, from edge to edge

  std::vector<float> views(const Detector& detector) const {
    struct Body {
      double x, y, z, radius, density;
    };
    base::Random random(1);
    std::vector<Body> bodies;
    for (int i = 0; i < 300; ++i)
      bodies.push_back({random.uniform(-200, 200), random.uniform(-20, kHeight + 20),
                        random.uniform(-25, 25), random.uniform(2, 8), random.uniform(-2, 3)});
    std::vector<float> values;
    for (int view = 0; view < kViews; ++view) {
      const double tilt = tilt_deg(view) * std::numbers::pi / 180.0;
      std::vector<double> image(kWidth * kHeight);
      const auto add = [&](const Body& body, bool is_rod) {
        const double at_x = kWidth / 2.0 + body.x * std::cos(tilt) + body.z * std::sin(tilt);
        const double at_y = body.y + shift_y_px(view);
        const std::int64_t first_x = std::lround(std::max(at_x - 4 * body.radius, 0.0));
        const std::int64_t last_x = std::lround(std::min(at_x + 4 * body.radius, 1.0 * kWidth));
        for (std::int64_t y = 0; y < kHeight; ++y) {
          for (std::int64_t x = first_x; x < last_x; ++x) {
            const double dx = (static_cast<double>(x) + 0.5 - at_x) / body.radius;
            const double dy = is_rod ? 0.0 : (static_cast<double>(y) + 0.5 - at_y) / body.radius;
            image[static_cast<std::size_t>(y * kWidth + x)] +=
                body.density * std::exp(-0.5 * (dx * dx + dy * dy));
          }
        }
      };
      for (const Body& body : bodies) add(body, false);
      if (has_rod) add({30.0, 0.0, 5.0, 1.5, 6.0}, true);
      for (std::int64_t y = 0; y < kHeight; ++y)
        for (std::int64_t x = 0; x < kWidth; ++x)
          values.push_back(static_cast<float>(100.0 +
                                              image[static_cast<std::size_t>(y * kWidth + x)] +
                                              kNoise * random.normal() + detector(x, y, view)));
    }
    return values;
  }
};

TiltSeriesOptions options_of(std::vector<float> views) {
  std::vector<double> tilts;
  for (int view = 0; view < kViews; ++view) tilts.push_back(tilt_deg(view));
  TiltSeriesOptions options;
  options.images = io::image_stack_in_memory(std::move(views), kWidth, kHeight, tilts, 10.0);
  options.contrast = Contrast::kBright;
  return options;
}

struct Read {
  std::vector<float> values;
  std::vector<std::uint8_t> valid;
};

Read read_all(const TiltSeries& series) {
  Read read;
  const auto pixels = static_cast<std::size_t>(series.width() * series.height());
  std::vector<float> values(pixels);
  std::vector<std::uint8_t> valid(pixels);
  for (std::size_t view = 0; view < series.views().size(); ++view) {
    series.read_view(view, values, valid);
    read.values.insert(read.values.end(), values.begin(), values.end());
    read.valid.insert(read.valid.end(), valid.begin(), valid.end());
  }
  return read;
}

double rms_difference(const std::vector<float>& a, const std::vector<float>& b) {
  double squares = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) squares += std::pow(a[i] - b[i], 2);
  return std::sqrt(squares / static_cast<double>(a.size()));
}

double of_line(std::int64_t line) {
  base::Random random(static_cast<std::uint64_t>(line) + 1000);
  return 0.7 * random.normal();
}

double columns(std::int64_t x, std::int64_t, int) { return of_line(x); }

TEST(FixedPattern, ColumnsAreRemoved) {
  const std::vector<float> clean = Scene().views(nothing);
  const TiltSeries series(options_of(Scene().views(columns)));
  EXPECT_NEAR(series.mask_metrics().fixed_pattern.column_deviation, 0.7, 0.15);
  EXPECT_EQ(series.mask_metrics().fixed_pattern.row_deviation, 0.0);
  EXPECT_LT(rms_difference(read_all(series).values, clean), 0.35 * 0.7);
}

TEST(FixedPattern, ViewsMayHaveSeveralPatternsOfDifferentStrengths) {
  const Detector two = [](std::int64_t x, std::int64_t, int view) {
    const double part = 0.5 + 0.5 * std::sin(view);
    return 2.0 * part * of_line(x) + 2.0 * (1.0 - part) * of_line(500 + x);
  };
  const std::vector<float> clean = Scene().views(nothing), with = Scene().views(two);
  const TiltSeries series(options_of(with));
  EXPECT_LT(rms_difference(read_all(series).values, clean), 0.4 * rms_difference(with, clean));
}

TEST(FixedPattern, NothingChangesWithoutAPattern) {
  for (const bool has_rod : {false, true}) {
    Scene scene;
    scene.has_rod = has_rod;
    TiltSeriesOptions options = options_of(scene.views(nothing));
    const TiltSeries series(options);
    EXPECT_FALSE(series.mask_metrics().fixed_pattern.is_any());
    EXPECT_EQ(read_all(series).values, scene.views(nothing));
  }
}

TEST(FixedPattern, NothingIsRemovedWhenToldSoNorInShortSeries) {
  const std::vector<float> with = Scene().views(columns);
  TiltSeriesOptions options = options_of(with);
  options.remove_fixed_pattern = false;
  EXPECT_EQ(read_all(TiltSeries(options)).values, with);
  options.remove_fixed_pattern = true;
  options.exclude = fmt::format("1-{}", kViews - 7);
  EXPECT_FALSE(TiltSeries(options).mask_metrics().fixed_pattern.is_any());
}

TEST(FixedPattern, PixelsThatDifferInAllViewsAreMasked) {
  const auto is_odd = [](std::int64_t x, std::int64_t y) { return x % 40 == 7 && y % 30 == 11; };
  const TiltSeries series(options_of(Scene().views([&](std::int64_t x, std::int64_t y, int) {
    return is_odd(x, y) ? (x % 80 == 7 ? 3.0 : -3.0) : 0.0;
  })));
  const Read read = read_all(series);
  std::size_t num_odd = 0;
  for (std::int64_t y = 0; y < kHeight; ++y) {
    for (std::int64_t x = 0; x < kWidth; ++x) {
      num_odd += is_odd(x, y);
      EXPECT_EQ(read.valid[static_cast<std::size_t>(y * kWidth + x)] == 0, is_odd(x, y))
          << x << ' ' << y;
    }
  }
  EXPECT_EQ(series.mask_metrics().fixed_pattern.num_pixels, num_odd);
}

TEST(FixedPattern, RowsAcrossTheAxisAreRemovedOnlyFromViewsThatTheAlignmentShifts) {
  const Detector rows = [](std::int64_t, std::int64_t y, int) { return of_line(y); };
  const TiltSeries aligned(options_of(Scene().views(rows)));
  EXPECT_FALSE(aligned.mask_metrics().fixed_pattern.is_any());

  Scene moving;
  moving.shift_y_px = [](int view) { return 5.0 * (view % 5) - 10.0; };
  const testing::ScratchDirectory scratch;
  std::string transforms;
  for (int view = 0; view < kViews; ++view)
    transforms += fmt::format("1 0 0 1 0 {}\n", -moving.shift_y_px(view));
  const auto read_shifted = [&](const Detector& detector) {
    TiltSeriesOptions options = options_of(moving.views(detector));
    options.xf = scratch.write("a.xf", transforms);
    return std::make_unique<TiltSeries>(options);
  };
  const auto clean = read_shifted(nothing), with = read_shifted(rows);
  EXPECT_FALSE(clean->mask_metrics().fixed_pattern.is_any());
  EXPECT_NEAR(with->mask_metrics().fixed_pattern.row_deviation, 0.7, 0.15);
  EXPECT_LT(rms_difference(read_all(*with).values, read_all(*clean).values), 0.35 * 0.7);
}

TEST(FixedPattern, HasTheSameBitsForAnyNumberOfThreads) {
  const std::vector<float> views = Scene().views(columns);
  base::set_thread_count(1);
  const Read alone = read_all(TiltSeries(options_of(views)));
  base::set_thread_count(5);
  const Read together = read_all(TiltSeries(options_of(views)));
  base::set_thread_count(0);
  EXPECT_EQ(alone.values, together.values);
  EXPECT_EQ(alone.valid, together.valid);
}

}  // namespace
}  // namespace tomofield::tilt_series
