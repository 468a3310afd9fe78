#include "evaluate/sheet_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "random_arrays.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

// Fills a volume with a function of the position from its centre, in voxels.
template <typename Function>
base::Volume filled(const base::Shape3& shape, const Function& function) {
  base::Volume volume(shape, 10.0);
  const auto centred = [](std::int64_t i, std::int64_t n) {
    return static_cast<double>(i) + 0.5 - static_cast<double>(n) / 2.0;
  };
  for (std::int64_t z = 0; z < shape.nz; ++z)
    for (std::int64_t y = 0; y < shape.ny; ++y)
      for (std::int64_t x = 0; x < shape.nx; ++x)
        volume.at(x, y, z) = static_cast<float>(
            function(centred(x, shape.nx), centred(y, shape.ny), centred(z, shape.nz)));
  return volume;
}

constexpr base::Shape3 kShape{31, 33, 35};
// Wide enough for central differences to be right within a few percent.
constexpr double kSheetSigma = 3.0, kBlur = 3.0;

TEST(SheetResponse, IsTheSecondDerivativeAcrossATiltedSheet) {
  const double c = std::cos(0.6), s = std::sin(0.6);
  const auto sheet = filled(kShape, [&](double x, double, double z) {
    const double u = c * x + s * z;
    return std::exp(-0.5 * u * u / (kSheetSigma * kSheetSigma));
  });
  // The blurred profile has variance a² + b²; its second derivative in the middle is −a / (…)^1.5.
  const double variance = kSheetSigma * kSheetSigma + kBlur * kBlur;
  const double expected = kSheetSigma / std::pow(variance, 1.5);
  const base::Volume response = sheet_response(sheet, kBlur);
  EXPECT_NEAR(response.at(15, 16, 17), expected, 0.05 * expected);  // central differences
  EXPECT_LT(response.at(15, 16, 29), 0.05 * expected);
}

TEST(SheetResponse, IsZeroInABallAndInAGap) {
  const auto ball = filled(kShape, [](double x, double y, double z) {
    return std::exp(-0.5 * (x * x + y * y + z * z) / 9.0);
  });
  EXPECT_NEAR(sheet_response(ball, kBlur).at(15, 16, 17), 0.0, 1e-6);
  const auto gap = filled(kShape, [](double x, double, double) { return -std::exp(-x * x / 4.0); });
  EXPECT_NEAR(sheet_response(gap, kBlur).at(15, 16, 17), 0.0, 1e-6);
}

base::Volume shell(double radius, double half_width) {
  return filled({48, 48, 48}, [&](double x, double y, double z) {
    return std::abs(std::sqrt(x * x + y * y + z * z) - radius) < half_width ? 1.0 : 0.0;
  });
}

TEST(MembraneScore, IsHighForTheMembraneAndThatOfChanceForNoise) {
  const base::Volume label = shell(15.0, 2.0);
  const DetectionScore found = membrane_score(label, label);
  EXPECT_GT(found.best_dice, 0.85);
  EXPECT_GT(found.average_precision, 0.9);
  base::Volume noise(label.shape, 10.0);
  noise.data = testing::random_floats(noise.data.size(), 4);
  double share = 0.0;
  for (const float value : label.data) share += static_cast<double>(value);
  share /= static_cast<double>(label.data.size());
  EXPECT_NEAR(membrane_score(noise, label).average_precision, share, 0.3 * share);
}

TEST(MembraneScore, DoesNotDependOnScaleAndOffset) {
  const base::Volume label = shell(15.0, 2.0);
  base::Volume volume = shell(15.0, 2.0);
  const auto noise = testing::random_floats(volume.data.size(), 5);
  for (std::size_t i = 0; i < noise.size(); ++i) volume.data[i] += 2.0f * noise[i];
  const double before = membrane_score(volume, label).best_dice;
  for (float& value : volume.data) value = 4.0f * value - 3.0f;
  EXPECT_NEAR(membrane_score(volume, label).best_dice, before, 1e-3);
}

TEST(MembraneScore, RefusesALabelWithoutMembranes) {
  const base::Volume label({16, 16, 16}, 10.0);
  EXPECT_THROW(membrane_score(label, label), Error);
  const base::Volume volume = shell(15.0, 2.0);
  base::Volume everywhere = volume;
  std::ranges::fill(everywhere.data, 1.0f);
  EXPECT_THROW(membrane_score(volume, everywhere), Error);
  base::Volume broken = volume;
  broken.data[7] = std::nanf("");
  EXPECT_THROW(membrane_score(volume, broken), Error);
}

}  // namespace
}  // namespace tomofield::evaluate
