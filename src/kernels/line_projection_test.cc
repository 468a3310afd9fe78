#include "kernels/line_projection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

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

// A line of samples −1 … num_samples (padding included) in an unaligned
// buffer. Columns along z have a stride that is no multiple of the lanes.
struct Line {
  int num_samples;
  std::ptrdiff_t stride;
  std::vector<float> values;
  Line(int count, bool is_column, std::uint64_t seed)
      : num_samples(count),
        stride(is_column ? 3 * kLanes + 5 : kLanes),
        values(random_floats(static_cast<std::size_t>(1 + (count + 2) * stride), seed)) {}
  std::ptrdiff_t origin() const { return 1 + stride; }  // of sample 0
};

std::vector<float> random_detector(int num_pixels, std::uint64_t seed) {
  return random_floats(static_cast<std::size_t>(1 + num_pixels * kLanes), seed);
}

struct Case {
  int num_samples, num_pixels;
  float step;
  bool is_column;
};

// Steps of rows (1 / cos), of columns (1 / sin) and of coarse samples
// (a margin's), either sign.
const std::vector<Case> kCases = {
    {1, 1, 1.0f, false},     {1, 7, 0.5f, true},       {3, 1, -1.0f, false},
    {7, 17, 0.25f, false},   {17, 33, -0.75f, true},   {33, 40, 1.0f, false},
    {33, 31, -1.25f, true},  {40, 17, 2.0f, false},    {40, 7, -3.5f, true},
    {17, 80, 0.1875f, true}, {50, 17, 1.4375f, false},
};

// The line as the view sees it, centred more or less. All numbers are small
// multiples of 1/32: positions are exact, so both implementations must make
// the same decision at the cuts, which positions often hit.
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

class Projection {
 public:
  Projection(const Case& c, int num_lines)
      : case_(c), detector_(random_detector(c.num_pixels, 77)) {
    for (int l = 0; l < num_lines; ++l) {
      lines_.emplace_back(c.num_samples, c.is_column, static_cast<std::uint64_t>(l));
      crossings_.push_back(dyadic_crossing(c, l % 5));
    }
    for (int l = 0; l < num_lines; ++l) {
      Line& line = lines_[static_cast<std::size_t>(l)];
      crossings_[static_cast<std::size_t>(l)].samples = line.values.data() + line.origin();
    }
  }

  void compare_with_reference(int first, int end) {
    auto expected = to_double(detector_);
    for (std::size_t l = 0; l < lines_.size(); ++l) {
      const auto samples = to_double(lines_[l].values);
      reference::project_line(crossings_[l], case_.num_samples, lines_[l].stride, first, end,
                              samples.data() + lines_[l].origin(), expected.data() + 1);
    }
    project_lines(crossings_.data(), static_cast<int>(lines_.size()), lines_[0].stride, first, end,
                  detector_.data() + 1);
    expect_near(detector_, expected, 4e-7 * static_cast<double>(lines_.size() + 1));
  }

 private:
  Case case_;
  std::vector<float> detector_;
  std::vector<Line> lines_;
  std::vector<LineCrossing> crossings_;
};

TEST(LineProjection, AgreesWithTheReference) {
  for_each_simd_target([] {
    for (const Case& c : kCases) {
      SCOPED_TRACE(::testing::Message()
                   << c.num_samples << " samples, " << c.num_pixels << " pixels, step " << c.step);
      for (const int num_lines : {1, 3, 8, 9, 33}) {
        Projection(c, num_lines).compare_with_reference(0, c.num_pixels);
      }
      Projection(c, 3).compare_with_reference(c.num_pixels / 3, c.num_pixels / 2);
    }
  });
}

// One line seen by several views: every case at once, so that views of
// different steps and widths meet.
class Backprojection {
 public:
  Backprojection(int num_samples, bool is_column) : line_(num_samples, is_column, 5) {
    for (const Case& like : kCases) {
      for (int variant = 0; variant < 5; ++variant) {
        Case c = like;
        c.num_samples = num_samples;
        detectors_.push_back(random_detector(c.num_pixels, detectors_.size()));
        crossings_.push_back(dyadic_crossing(c, variant));
      }
    }
    for (std::size_t i = 0; i < detectors_.size(); ++i) {
      crossings_[i].detector = detectors_[i].data() + 1;
    }
  }

  void compare_with_reference(int first, int end) {
    auto expected = to_double(line_.values);
    for (std::size_t i = 0; i < crossings_.size(); ++i) {
      const auto detector = to_double(detectors_[i]);
      reference::backproject_line(crossings_[i], line_.stride, first, end, detector.data() + 1,
                                  expected.data() + line_.origin());
    }
    run(first, end);
    expect_near(line_.values, expected, 1e-5);
  }

  void run(int first, int end) {
    backproject_lines(crossings_.data(), static_cast<int>(crossings_.size()), line_.stride, first,
                      end, line_.values.data() + line_.origin());
  }
  const std::vector<float>& values() const { return line_.values; }

 private:
  Line line_;
  std::vector<std::vector<float>> detectors_;
  std::vector<LineCrossing> crossings_;
};

TEST(LineBackprojection, AgreesWithTheReference) {
  for_each_simd_target([] {
    for (const int num_samples : {1, 3, 7, 17, 33, 50}) {
      SCOPED_TRACE(num_samples);
      // Padding included.
      Backprojection(num_samples, false).compare_with_reference(-1, num_samples + 1);
      Backprojection(num_samples, true).compare_with_reference(-1, num_samples + 1);
      Backprojection(num_samples, true).compare_with_reference(num_samples / 3, num_samples / 2);
    }
  });
}

TEST(LineBackprojection, IsTheSameBitsInOnePieceOrTwo) {
  for_each_simd_target([] {
    Backprojection whole(50, true), pieces(50, true);
    whole.run(-1, 51);
    pieces.run(-1, 18);
    pieces.run(18, 51);
    EXPECT_EQ(whole.values(), pieces.values());
  });
}

// A plane of rows (or columns) far from the origin of the detector, seen by
// views of all angles: <A f, r> = <f, Aᵀ r>.
void check_adjoint(bool is_column, int num_lines, int num_samples, int num_pixels, double origin) {
  base::Random random(11);
  const std::vector<double> angles = {-80, -45, -26.57, -0.01, 0, 1e-3, 10, 45, 60, 71.57};
  std::vector<Line> image, gradient;
  for (int l = 0; l < num_lines; ++l) {
    image.emplace_back(num_samples, is_column, static_cast<std::uint64_t>(l));
    gradient.emplace_back(num_samples, is_column, 0);
    gradient.back().values.assign(image.back().values.size(), 0.0f);
  }
  std::vector<std::vector<float>> projected(angles.size()), residual;
  std::vector<std::vector<LineCrossing>> by_line(image.size());
  for (std::size_t v = 0; v < angles.size(); ++v) {
    projected[v].assign(static_cast<std::size_t>(num_pixels * kLanes), 0.0f);
    residual.push_back(random_floats(projected[v].size(), 500 + v));
    const double tilt = angles[v] * M_PI / 180;
    std::vector<LineCrossing> view;
    for (std::size_t l = 0; l < image.size(); ++l) {
      LineCrossing c;
      c.step = static_cast<float>(1 / (is_column ? 2.5 * std::sin(tilt + 0.4) : std::cos(tilt)));
      c.offset = static_cast<float>(random.uniform(-5, 5) - static_cast<double>(c.step) * origin);
      c.low = l % 2 ? -1.0f : -0.5f;
      c.high = static_cast<float>(num_samples) - (l % 2 ? 0.0f : 0.5f);
      c.end_pixel = num_pixels;
      c.first_pixel = l % 3 ? 0 : num_pixels / 4;
      c.weight = static_cast<float>(random.uniform(0.5, 1.5));
      c.samples = image[l].values.data() + image[l].origin();
      view.push_back(c);
      c.detector = residual[v].data();
      by_line[l].push_back(c);
    }
    project_lines(view.data(), num_lines, image[0].stride, 0, num_pixels, projected[v].data());
  }
  double forward = 0.0, backward = 0.0, size = 0.0;
  for (std::size_t v = 0; v < angles.size(); ++v) {
    forward += testing::dot(projected[v], residual[v]);
    size += testing::dot(projected[v], projected[v]);
  }
  for (std::size_t l = 0; l < image.size(); ++l) {
    backproject_lines(by_line[l].data(), static_cast<int>(angles.size()), image[0].stride, -1,
                      num_samples + 1, gradient[l].values.data() + gradient[l].origin());
    backward += testing::dot(gradient[l].values, image[l].values);
  }
  EXPECT_GT(size, 0.0);
  // Float sums of `size` random products: errors grow like its root.
  EXPECT_NEAR(forward, backward, 1e-6 * size / std::sqrt(size) * 10) << "size " << size;
}

TEST(LineBackprojection, IsTheAdjointOfProjection) {
  for_each_simd_target([] {
    for (const bool is_column : {false, true}) {
      check_adjoint(is_column, 1, 3, 5, 2.0);
      check_adjoint(is_column, 17, 33, 40, 20.0);
      check_adjoint(is_column, 9, 300, 4096, 3900.0);
    }
  });
}

}  // namespace
}  // namespace tomofield::kernels
