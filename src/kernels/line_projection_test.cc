#include "kernels/line_projection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "base/random.h"
#include "kernels/lanes.h"
#include "kernels/reference/reference_kernels.h"
#include "random_arrays.h"
#include "simd_targets.h"

namespace tomofield::kernels {
namespace {

using testing::expect_near;
using testing::for_each_simd_target;
using testing::random_floats;
using testing::to_double;

// Lines of samples −1 … num_samples (padding included), one after the other in an unaligned buffer.
// Columns along z have a stride that is no multiple of the lanes.
struct Lines {
  int num_samples;
  std::ptrdiff_t stride;
  std::vector<float> values;
  Lines(int count, int samples, bool are_columns, std::uint64_t seed)
      : num_samples(samples),
        stride(are_columns ? 3 * kLanes + 5 : kLanes),
        values(random_floats(static_cast<std::size_t>(1 + count * line_size()), seed)) {}
  std::ptrdiff_t line_size() const { return (num_samples + 2) * stride; }
  std::ptrdiff_t origin(std::size_t line) const {  // position of sample 0
    return 1 + static_cast<std::ptrdiff_t>(line) * line_size() + stride;
  }
  float* sample0(std::size_t line) { return values.data() + origin(line); }
};

// Views, one after the other in an unaligned buffer, with one more pixel that may be read.
struct Detectors {
  int num_pixels;
  std::vector<float> values;
  Detectors(int num_views, int pixels, std::uint64_t seed)
      : num_pixels(pixels),
        values(
            random_floats(static_cast<std::size_t>(1 + (num_views * pixels + 1) * kLanes), seed)) {}
  std::ptrdiff_t origin(std::size_t view) const {
    return 1 + static_cast<std::ptrdiff_t>(view) * num_pixels * kLanes;
  }
  float* pixel0(std::size_t view) { return values.data() + origin(view); }
};

struct Case {
  int num_samples, num_pixels;
  float step;
  bool is_column;
};

// The steps are those of rows (1 / cos), of columns (1 / sin) and of a margin's coarse samples,
// with either sign; 0.99993896 is just below 1.
const std::vector<Case> kCases = {
    {1, 1, 1.0f, false},          {1, 7, 0.5f, true},       {3, 1, -1.0f, false},
    {7, 17, 0.25f, false},        {17, 33, -0.75f, true},   {33, 40, 1.0f, false},
    {33, 31, -1.25f, true},       {40, 17, 2.0f, false},    {40, 7, -3.5f, true},
    {17, 80, 0.1875f, true},      {50, 17, 1.4375f, false}, {100, 90, -1.125f, true},
    {33, 33, 0.99993896f, false}, {70, 120, 0.625f, false}, {2, 40, 1.0f, false},
    {3, 60, -1.25f, true},
};

// Returns the line as the view sees it, roughly centred. All numbers are small binary fractions, so
// positions are exact. Both implementations must then make the same decision at the cuts, which
// positions often hit.
LineCrossing dyadic_crossing(const Case& c, int variant) {
  LineCrossing line;
  line.step = c.step;
  const float middle = 0.5f * static_cast<float>(c.num_samples - 1) -
                       0.5f * c.step * static_cast<float>(c.num_pixels - 1);
  line.offset = std::round(8.0f * middle) / 8.0f + 0.375f * static_cast<float>(variant);
  const bool whole_hats = variant % 2 == 0;
  line.low = whole_hats ? -1.0f : -0.5f;
  line.high = static_cast<float>(c.num_samples) - (whole_hats ? 0.0f : 0.5f);
  line.first_pixel = variant == 1 ? c.num_pixels / 3 : 0;
  line.end_pixel = variant == 2 ? c.num_pixels * 2 / 3 : c.num_pixels;
  line.weight = 0.5f + 0.25f * static_cast<float>(variant);
  return line;
}
constexpr int kVariants = 5;

// Projects lines that lie in `source` together.
void project(const std::vector<LineCrossing>& lines, const float* source, std::ptrdiff_t stride,
             int first, int end, float* detector) {
  std::vector<CrossingGroup> groups;
  group_lines(lines, source, groups);
  project_lines(groups.data(), static_cast<int>(groups.size()), source, stride, first, end,
                detector);
}

void backproject(const std::vector<LineCrossing>& views, const float* source, std::ptrdiff_t stride,
                 int first, int end, float* samples) {
  std::vector<CrossingGroup> groups;
  group_views(views, source, groups);
  backproject_lines(groups.data(), static_cast<int>(groups.size()), source, stride, first, end,
                    samples);
}

// Compares with the reference. Each line's samples lie `slant` further along than the previous
// line's.
void compare_projection(const Case& c, int num_lines, int first, int end, float slant = 0) {
  Lines lines(num_lines, c.num_samples, c.is_column, 3);
  Detectors detector(1, c.num_pixels, 77);
  const auto samples = to_double(lines.values);
  auto expected = to_double(detector.values);
  std::vector<LineCrossing> crossings;
  for (std::size_t l = 0; l < static_cast<std::size_t>(num_lines); ++l) {
    crossings.push_back(dyadic_crossing(c, static_cast<int>(l % kVariants)));
    crossings[l].offset += slant * static_cast<float>(l);
    crossings[l].samples = lines.sample0(l);
    reference::project_line(crossings[l], c.num_samples, lines.stride, first, end,
                            samples.data() + lines.origin(l), expected.data() + 1);
  }
  project(crossings, lines.values.data(), lines.stride, first, end, detector.pixel0(0));
  expect_near(detector.values, expected, 4e-7 * (num_lines + 1));
}

TEST(LineProjection, AgreesWithTheReference) {
  for_each_simd_target([] {
    for (const Case& c : kCases) {
      SCOPED_TRACE(::testing::Message()
                   << c.num_samples << " samples, " << c.num_pixels << " pixels, step " << c.step);
      for (const int num_lines : {1, 3, 8, 9, 33}) {
        compare_projection(c, num_lines, 0, c.num_pixels);
      }
      // With these slants, few or no pixels see all lines of a group.
      for (const float slant : {1.25f, -4.0f}) {
        for (int pixel = 0; pixel < c.num_pixels; ++pixel)
          compare_projection(c, 8, pixel, pixel + 1, slant);
      }
      compare_projection(c, 3, c.num_pixels / 3, c.num_pixels / 2);
    }
  });
}

// Backprojects views of every case and variant onto one line at once.
class Backprojection {
 public:
  Backprojection(int num_samples, bool is_column)
      : line_(1, num_samples, is_column, 5),
        detectors_(static_cast<int>(kCases.size()) * kVariants, 120, 6) {
    for (Case c : kCases) {
      c.num_samples = num_samples;
      for (int variant = 0; variant < kVariants; ++variant) {
        crossings_.push_back(dyadic_crossing(c, variant));
        crossings_.back().detector = detectors_.pixel0(crossings_.size() - 1);
      }
    }
  }

  void compare_with_reference(int first, int end) {
    auto expected = to_double(line_.values);
    const auto detectors = to_double(detectors_.values);
    for (std::size_t i = 0; i < crossings_.size(); ++i) {
      reference::backproject_line(crossings_[i], line_.stride, first, end,
                                  detectors.data() + detectors_.origin(i),
                                  expected.data() + line_.origin(0));
    }
    backproject(crossings_, detectors_.values.data(), line_.stride, first, end, line_.sample0(0));
    expect_near(line_.values, expected, 2e-5);
  }

 private:
  Lines line_;
  Detectors detectors_;
  std::vector<LineCrossing> crossings_;
};

TEST(LineBackprojection, AgreesWithTheReference) {
  for_each_simd_target([] {
    for (const int num_samples : {1, 3, 7, 17, 33, 50, 100}) {
      SCOPED_TRACE(num_samples);
      // Samples −1 and num_samples are the padding.
      Backprojection(num_samples, false).compare_with_reference(-1, num_samples + 1);
      Backprojection(num_samples, true).compare_with_reference(-1, num_samples + 1);
      Backprojection(num_samples, true).compare_with_reference(num_samples / 3, num_samples / 2);
    }
  });
}

// One view alone in its group, so that tiles inside the window are processed without tests. The
// window's ends pass every sample of the tiles.
TEST(LineBackprojection, AgreesWhereTheWindowEnds) {
  constexpr int kSamples = 100, kTile = 32;
  const auto compare = [](float step, int variant, int shift) {
    SCOPED_TRACE(::testing::Message()
                 << "step " << step << ", variant " << variant << ", shift " << shift);
    Lines line(1, kSamples, false, 5);
    Detectors detectors(1, 120, 6);
    auto expected = to_double(line.values);
    const auto pixels = to_double(detectors.values);
    LineCrossing view = dyadic_crossing({kSamples, 120, step, false}, variant);
    view.first_pixel = 45 - shift;
    view.end_pixel = 75 + shift;
    view.detector = detectors.pixel0(0);
    reference::backproject_line(view, line.stride, -1, kSamples + 1,
                                pixels.data() + detectors.origin(0),
                                expected.data() + line.origin(0));
    for (int first = -1; first < kSamples + 1; first += kTile) {
      backproject({view}, detectors.values.data(), line.stride, first,
                  std::min(first + kTile, kSamples + 1), line.sample0(0));
    }
    expect_near(line.values, expected, 2e-6);
  };
  for_each_simd_target([&] {
    for (const float step : {1.0f, -1.0f, -1.25f, 1.4375f, 2.0f})
      for (const int variant : {0, 1, 3})
        for (int shift = 0; shift < kTile; ++shift) compare(step, variant, shift);
  });
}

// Checks <A f, r> = <f, Aᵀ r> for rows (or columns) seen by views of all angles, far from the
// detector's origin.
void check_adjoint(bool are_columns, int num_lines, int num_samples, int num_pixels,
                   double origin) {
  base::Random random(11);
  const std::vector<double> tilts_deg = {-80, -45, -26.57, -0.01, 0, 1e-3, 10, 45, 60, 71.57};
  const int num_views = static_cast<int>(tilts_deg.size());
  Lines image(num_lines, num_samples, are_columns, 1), gradient = image;
  Detectors projected(num_views, num_pixels, 2), residual(num_views, num_pixels, 3);
  std::fill(gradient.values.begin(), gradient.values.end(), 0.0f);
  std::fill(projected.values.begin(), projected.values.end(), 0.0f);
  std::vector<std::vector<LineCrossing>> by_line(static_cast<std::size_t>(num_lines));
  for (std::size_t v = 0; v < tilts_deg.size(); ++v) {
    const double tilt = tilts_deg[v] * std::numbers::pi / 180;
    std::vector<LineCrossing> view;
    for (std::size_t l = 0; l < by_line.size(); ++l) {
      LineCrossing c;
      c.step = static_cast<float>(1 / (are_columns ? 2.5 * std::sin(tilt + 0.4) : std::cos(tilt)));
      c.offset = static_cast<float>(random.uniform(-5, 5) - static_cast<double>(c.step) * origin);
      c.low = l % 2 ? -1.0f : -0.5f;
      c.high = static_cast<float>(num_samples) - (l % 2 ? 0.0f : 0.5f);
      c.end_pixel = num_pixels;
      c.first_pixel = l % 3 ? 0 : num_pixels / 4;
      c.weight = static_cast<float>(random.uniform(0.5, 1.5));
      c.samples = image.sample0(l);
      c.detector = residual.pixel0(v);
      view.push_back(c);
      by_line[l].push_back(c);
    }
    project(view, image.values.data(), image.stride, 0, num_pixels, projected.pixel0(v));
  }
  for (std::size_t l = 0; l < by_line.size(); ++l) {
    backproject(by_line[l], residual.values.data(), image.stride, -1, num_samples + 1,
                gradient.sample0(l));
  }
  const double size = std::sqrt(testing::dot(projected.values, projected.values));
  EXPECT_GT(size, 0.0);
  // Both sides sum random products, whose errors grow like the root of their number.
  EXPECT_NEAR(testing::dot(projected.values, residual.values),
              testing::dot(gradient.values, image.values), 1e-5 * size);
}

TEST(LineBackprojection, IsTheAdjointOfProjection) {
  for_each_simd_target([] {
    for (const bool are_columns : {false, true}) {
      check_adjoint(are_columns, 1, 3, 5, 2.0);
      check_adjoint(are_columns, 17, 33, 40, 20.0);
      check_adjoint(are_columns, 9, 300, 4096, 3900.0);
    }
  });
}

}  // namespace
}  // namespace tomofield::kernels
