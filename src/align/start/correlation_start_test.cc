#include "align/start/correlation_start.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "base/random.h"
#include "base/threads/parallel.h"

namespace tomofield::alignment {
namespace {

using Shift = std::array<double, 2>;

constexpr std::int64_t kSize = 64;
constexpr double kThickness = 16.0;

struct Blob {
  double x, y, z, sigma, height;
};

std::vector<Blob> random_slab() {
  base::Random random(5);
  std::vector<Blob> blobs;
  for (int i = 0; i < 150; ++i)
    blobs.push_back({random.uniform(-60, 60), random.uniform(-45, 45),
                     random.uniform(-0.5 * kThickness, 0.5 * kThickness), random.uniform(1.2, 2.5),
                     random.uniform(0.5, 2.0)});
  return blobs;
}

double radians(double deg) { return deg * std::numbers::pi / 180.0; }

// Returns the exact projection of Gaussian blobs, with some noise, shifted.
CoarseView make_view(double tilt_deg, const Shift& shift, std::uint64_t seed) {
  static const std::vector<Blob> blobs = random_slab();
  CoarseView view{tilt_series::MaskedImage(kSize, kSize), tilt_deg};
  base::Random random(9, seed);
  for (float& value : view.image.values) value = static_cast<float>(0.1 * random.normal());
  for (const Blob& blob : blobs) {
    const double qx = blob.x * std::cos(radians(tilt_deg)) + blob.z * std::sin(radians(tilt_deg));
    const double px = qx + shift[0] + 0.5 * kSize - 0.5;
    const double py = blob.y + shift[1] + 0.5 * kSize - 0.5;
    for (std::int64_t y = 0; y < kSize; ++y)
      for (std::int64_t x = 0; x < kSize; ++x) {
        const double d = std::hypot(static_cast<double>(x) - px, static_cast<double>(y) - py);
        view.image.values[view.image.index(x, y)] +=
            static_cast<float>(blob.height * std::exp(-0.5 * d * d / (blob.sigma * blob.sigma)));
      }
  }
  return view;
}

struct Series {
  std::vector<CoarseView> views;
  std::vector<Shift> shifts;
};

Series make_series(int jumping_view = -1, double largest_shift = 4) {
  Series series;
  base::Random random(3);
  const auto any = [&] { return random.uniform(-largest_shift, largest_shift); };
  for (int i = 0; i < 31; ++i) {
    Shift shift{any(), any()};
    if (i == jumping_view) shift[0] += 0.2 * kSize;
    series.shifts.push_back(shift);
    series.views.push_back(make_view(-60.0 + 4.0 * i, shift, static_cast<std::uint64_t>(i)));
  }
  return series;
}

// Returns the largest error that is left when a combination of cos θ and sin θ is removed from the
// x shifts and the mean from the y shifts. The angles are symmetrical, so both are orthogonal.
double largest_error(const Series& series, const std::vector<Shift>& found) {
  double cc = 0, ss = 0, c = 0, s = 0, y = 0, largest = 0;
  for (std::size_t v = 0; v < found.size(); ++v) {
    const double tilt = radians(series.views[v].tilt_deg);
    const double error = found[v][0] - series.shifts[v][0];
    cc += std::cos(tilt) * std::cos(tilt);
    ss += std::sin(tilt) * std::sin(tilt);
    c += std::cos(tilt) * error;
    s += std::sin(tilt) * error;
    y += (found[v][1] - series.shifts[v][1]) / static_cast<double>(found.size());
  }
  for (std::size_t v = 0; v < found.size(); ++v) {
    const double tilt = radians(series.views[v].tilt_deg);
    largest = std::max({largest,
                        std::abs(found[v][0] - series.shifts[v][0] - c / cc * std::cos(tilt) -
                                 s / ss * std::sin(tilt)),
                        std::abs(found[v][1] - series.shifts[v][1] - y)});
  }
  return largest;
}

const CorrelationOptions kOptions{.thickness_px = kThickness};

TEST(CorrelationStart, FindsKnownShifts) {
  const Series series = make_series();
  const CorrelationStart start = correlate_views(series.views, kOptions);
  EXPECT_LT(largest_error(series, start.shift_px), 0.5);
  EXPECT_NEAR(start.shift_px[15][0], 0.0, 1e-9);  // of the view at zero tilt
}

TEST(CorrelationStart, FindsAViewThatJumped) {
  const Series series = make_series(18);
  EXPECT_LT(largest_error(series, correlate_views(series.views, kOptions).shift_px), 0.5);
}

// Views next to each other are up to 3/8 of the width apart.
TEST(CorrelationStart, FindsLargeShiftsOfAllViews) {
  const Series series = make_series(-1, 12);
  EXPECT_LT(largest_error(series, correlate_views(series.views, kOptions).shift_px), 0.6);
}

TEST(CorrelationStart, MaskedPixelsDoNotPull) {
  Series series = make_series();
  for (CoarseView& view : series.views)
    for (std::int64_t y = 20; y < 32; ++y)
      for (std::int64_t x = 8; x < 20; ++x) {
        view.image.values[view.image.index(x, y)] = 1000.0f;
        view.image.valid[view.image.index(x, y)] = 0;
      }
  EXPECT_LT(largest_error(series, correlate_views(series.views, kOptions).shift_px), 0.5);
}

TEST(CorrelationStart, AViewOfNoiseHasTheLeastConfidence) {
  Series series = make_series();
  base::Random random(1);
  for (float& value : series.views[22].image.values) value = static_cast<float>(random.normal());
  const CorrelationStart start = correlate_views(series.views, kOptions);
  EXPECT_EQ(
      std::min_element(start.confidence.begin(), start.confidence.end()) - start.confidence.begin(),
      22);
}

TEST(CorrelationStartThreads, SameBitsForAnyNumber) {
  const Series series = make_series();
  base::set_thread_count(1);
  const CorrelationStart one = correlate_views(series.views, kOptions);
  base::set_thread_count(2);
  const CorrelationStart two = correlate_views(series.views, kOptions);
  base::set_thread_count(0);
  EXPECT_EQ(one.shift_px, two.shift_px);
  EXPECT_EQ(one.confidence, two.confidence);
}

}  // namespace
}  // namespace tomofield::alignment
