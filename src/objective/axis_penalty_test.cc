#include "objective/axis_penalty.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "base/random.h"
#include "python_script.h"
#include "random_arrays.h"
#include "scratch_directory.h"

namespace tomofield::objective {
namespace {

using testing::random_floats;
using testing::ScratchDirectory;

constexpr SliceShape kShape{.slices = 3, .ny = 40, .nx = 54};

std::vector<float> noise(const SliceShape& shape, std::uint64_t seed) {
  base::Random random(seed);
  std::vector<float> values(shape.size());
  for (float& v : values) v = static_cast<float>(2.0 + 0.3 * random.normal());
  return values;
}

// Makes stripes along y with `cycles` over the width.
std::vector<float> with_stripes(const SliceShape& shape, std::vector<float> values, int cycles,
                                double height) {
  for (std::size_t n = 0; n < values.size(); ++n) {
    const double x = static_cast<double>(n % static_cast<std::size_t>(shape.nx)) / shape.nx;
    values[n] += static_cast<float>(height * std::cos(2.0 * std::numbers::pi * cycles * x));
  }
  return values;
}

double penalty(const SliceShape& shape, const std::vector<float>& samples,
               const AxisPenaltyOptions& options, std::vector<float>* gradient = nullptr) {
  std::vector<float> unused(samples.size());
  return axis_penalty(shape, samples, options, 1.0, gradient ? *gradient : unused);
}

void write_floats(const std::filesystem::path& path, const std::vector<float>& values) {
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(values.data()),
             static_cast<std::streamsize>(values.size() * sizeof(float)));
}

// Computes the penalty with numpy, as the header defines it.
TEST(AxisPenalty, IsWhatNumpyFinds) {
  if (!testing::python_has("numpy")) GTEST_SKIP() << "python3-numpy is not installed";
  const ScratchDirectory scratch;
  const auto samples = with_stripes(kShape, noise(kShape, 1), 9, 0.2);
  write_floats(scratch / "samples.f32", samples);
  for (const auto reference : {RingReference::kMean, RingReference::kMax}) {
    const bool is_mean = reference == RingReference::kMean;
    AxisPenaltyOptions options;
    options.reference = reference;
    std::ofstream(scratch / "case.txt")
        << (is_mean ? "mean " : "max ") << penalty(kShape, samples, options) << "\n";
    std::ofstream rings(scratch / "rings.txt");
    for (const double r : ring_references(SliceSpectra(kShape, samples), reference))
      rings << r << "\n";
    rings.close();
    EXPECT_EQ(testing::run_python(scratch, R"(
import numpy as np
f = np.fromfile('samples.f32', 'f4').reshape(3, 40, 54).astype('f8')
kind, found = open('case.txt').read().split()
rings = np.loadtxt('rings.txt')
hann = lambda n: np.sqrt(8 / 3) * np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
a = abs(np.fft.fft2(f * hann(40)[:, None] * hann(54), norm='ortho'))
u, v = np.meshgrid(np.fft.fftfreq(54), np.fft.fftfreq(40))
radius = np.hypot(u, v)
ring = np.round(radius * 54).astype(int)
counts = (abs(u * 54) > 1.5) & (abs(v * 40) > 1.5)
total = 0
for k in range(28):
    members = counts & (ring == k)
    if not members.any():
        assert rings[k] == -1
        continue
    values = a[:, members]
    reference = values.mean() if kind == 'mean' else values.max(axis=1).mean()
    assert abs(rings[k] - reference) < 1e-4 * reference, (k, rings[k], reference)
    axis = (ring == k) & (((u == 0) & (abs(v * 40) > 1.5)) | ((v == 0) & (abs(u * 54) > 1.5)))
    w = 1 / (np.exp((0.2 - 2 * radius[axis]) / 0.05) + 1)
    amplitude = (np.sqrt(a[:, axis] ** 2 + 1e-6) - 1e-3).mean(axis=0)
    total += (w * np.maximum(0, amplitude - reference)).sum() / (54 + 40)
assert len(rings) == 28
assert total > 0.001 and abs(float(found) - total) < 1e-4 * total, (found, total)
)"),
              "")
        << is_mean;
  }
}

// Varies the stripes, which no ring contains, because the gradient takes the references as
// constants. The values stay away from the hinge.
TEST(AxisPenalty, GradientIsTheDerivativeAtFixedRings) {
  const auto samples = with_stripes(kShape, noise(kShape, 1), 9, 0.3);
  for (const double height : {0.0, 0.1}) {
    const auto at = with_stripes(kShape, samples, 14, height);
    std::vector<float> gradient(at.size());
    penalty(kShape, at, {}, &gradient);
    for (const int cycles : {9, 14}) {
      const std::vector<float> zeros(at.size());
      const auto direction = with_stripes(kShape, zeros, cycles, 1.0);
      constexpr double kStep = 1e-3;
      const double high = penalty(kShape, with_stripes(kShape, at, cycles, kStep), {});
      const double low = penalty(kShape, with_stripes(kShape, at, cycles, -kStep), {});
      const double expected = (high - low) / (2 * kStep);
      EXPECT_NEAR(testing::dot(gradient, direction), expected, 0.01 * std::abs(expected) + 1e-6);
    }
  }
}

TEST(AxisPenalty, LeavesAnIsotropicFieldAloneAndFindsStripes) {
  const SliceShape shape{.slices = 8, .ny = 64, .nx = 64};
  const auto plain = noise(shape, 3);
  for (const auto reference : {RingReference::kMean, RingReference::kMax}) {
    AxisPenaltyOptions options;
    options.reference = reference;
    // Noise of 0.3 has mean amplitude 0.27 on every ring and axis.
    const double isotropic = penalty(shape, plain, options);
    EXPECT_LT(isotropic, reference == RingReference::kMean ? 0.02 : 1e-3);
    EXPECT_GT(penalty(shape, with_stripes(shape, plain, 12, 0.2), options), isotropic + 0.05);
  }
}

TEST(AxisPenalty, DescentTakesStripesAwayAndLeavesTheRest) {
  const SliceShape shape{.slices = 4, .ny = 48, .nx = 48};
  const auto plain = noise(shape, 5);
  auto samples = with_stripes(shape, plain, 11, 0.15);
  const double before = penalty(shape, samples, {});
  for (int step = 0; step < 300; ++step) {
    std::vector<float> gradient(samples.size());
    axis_penalty(shape, samples, {}, 100.0, gradient);
    for (std::size_t n = 0; n < samples.size(); ++n) samples[n] -= gradient[n];
  }
  EXPECT_LT(penalty(shape, samples, {}), 0.1 * before);
  const auto squares = [&](const std::vector<float>& a) {
    double sum = 0.0;
    for (std::size_t n = 0; n < a.size(); ++n)
      sum += std::pow(static_cast<double>(a[n]) - static_cast<double>(plain[n]), 2);
    return sum;
  };
  // The stripes stay where the window vanishes.
  EXPECT_LT(squares(samples), 0.8 * squares(with_stripes(shape, plain, 11, 0.15)));
}

TEST(AxisPenalty, IsZeroForConstantsOfAnyShape) {
  for (const SliceShape& shape :
       {SliceShape{1, 2, 2}, SliceShape{2, 1, 9}, SliceShape{1, 33, 64}}) {
    const std::vector<float> samples(shape.size(), 3.0f);
    std::vector<float> gradient(shape.size());
    EXPECT_EQ(penalty(shape, samples, {}, &gradient), 0.0);
    EXPECT_EQ(gradient, std::vector<float>(shape.size()));
  }
}

}  // namespace
}  // namespace tomofield::objective
