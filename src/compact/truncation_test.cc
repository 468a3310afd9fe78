#include "compact/truncation.h"

#include <gtest/gtest.h>

#include <Eigen/SVD>

#include "random_arrays.h"

namespace tomofield::compact {
namespace {

// The counts are unequal, so that a confusion of axes fails.
constexpr int kX = 7, kY = 6, kZ = 5;

FloatMatrix random_matrix(Eigen::Index rows, Eigen::Index columns, std::uint64_t seed) {
  const std::vector<float> values =
      testing::random_floats(static_cast<std::size_t>(rows * columns), seed);
  return Eigen::Map<const FloatMatrix>(values.data(), rows, columns);
}

PlaceDensities place_of(FloatMatrix values) {
  return {.nx = kX, .ny = kY, .nz = kZ, .values = std::move(values), .volume_of_vertex = 100.0};
}

// Returns modes of these ranks; the vectors are not orthonormal.
Truncation random_modes(int rank_x, int rank_y, int rank_z) {
  Truncation modes;
  modes.x = {random_matrix(kX, rank_x, 1), random_matrix(kZ * kY, rank_x, 2)};
  modes.y = {random_matrix(kY, rank_y, 3), random_matrix(kX * kZ, rank_y, 4)};
  modes.z = {random_matrix(kZ, rank_z, 5), random_matrix(kX * kY, rank_z, 6)};
  return modes;
}

// Adds up the modes as docs/model-format.md says.
FloatMatrix sum_of(const Truncation& modes) {
  FloatMatrix values = FloatMatrix::Zero(kX, kZ * kY);
  for (int x = 0; x < kX; ++x) {
    for (int z = 0; z < kZ; ++z) {
      for (int y = 0; y < kY; ++y) {
        float& value = values(x, z * kY + y);
        for (int r = 0; r < modes.x.rank(); ++r)
          value += modes.x.vectors(x, r) * modes.x.matrices(z * kY + y, r);
        for (int r = 0; r < modes.y.rank(); ++r)
          value += modes.y.vectors(y, r) * modes.y.matrices(x * kZ + z, r);
        for (int r = 0; r < modes.z.rank(); ++r)
          value += modes.z.vectors(z, r) * modes.z.matrices(x * kY + y, r);
      }
    }
  }
  return values;
}

TEST(Truncation, ModesAddUpToValues) {
  const Truncation modes = random_modes(2, 1, 3);
  EXPECT_LT((values_of(modes, kX, kY, kZ) - sum_of(modes)).norm(), 1e-4);
}

TEST(Truncation, OfOneModeIsTheSingularValueDecomposition) {
  // Sections along z have rank 3, so that vectors along z are cheapest.
  const PlaceDensities place = place_of(sum_of(random_modes(0, 0, 3)));
  FloatMatrix sections(kZ, kX * kY);
  for (int x = 0; x < kX; ++x)
    for (int z = 0; z < kZ; ++z)
      for (int y = 0; y < kY; ++y) sections(z, x * kY + y) = place.values(x, z * kY + y);
  const Eigen::VectorXf singular =
      Eigen::JacobiSVD<Eigen::MatrixXf>(Eigen::MatrixXf(sections)).singularValues();
  const Truncation exact = truncate(place, 1e-6);
  EXPECT_EQ(exact.z.rank(), 3);
  EXPECT_EQ(exact.x.rank() + exact.y.rank(), 0);
  EXPECT_LT(exact.square_error, 1e-6 * static_cast<double>(place.values.squaredNorm()));
  // A price between the energies of the second and the third component drops the third. A mode
  // along x or y costs more for less of it.
  const double third = std::pow(static_cast<double>(singular(2)), 2);
  const double second = std::pow(static_cast<double>(singular(1)), 2);
  const Truncation two = truncate(place, std::sqrt(second * third) / (kZ + kX * kY));
  EXPECT_LE(two.z.rank(), 2);
  EXPECT_LE(two.square_error, third * 1.0001);
}

TEST(Truncation, FindsMixedModes) {
  const PlaceDensities place = place_of(sum_of(random_modes(1, 1, 1)));
  const Truncation found = truncate(place, 1e-7);
  EXPECT_LT(found.square_error, 1e-4 * static_cast<double>(place.values.squaredNorm()));
  EXPECT_NEAR(static_cast<double>((values_of(found, kX, kY, kZ) - place.values).squaredNorm()),
              found.square_error, 1e-5 * static_cast<double>(place.values.squaredNorm()));
}

TEST(Truncation, AHigherPriceBuysFewerParameters) {
  const PlaceDensities place = place_of(random_matrix(kX, kZ * kY, 9));
  std::size_t last = place.values.size() * 10;
  double last_error = -1;
  for (const double price : {1e-5, 1e-2, 0.03, 0.1, 1e3}) {
    const Truncation found = truncate(place, price);
    EXPECT_LE(found.num_parameters(), last);
    EXPECT_GE(found.square_error, last_error);
    last = found.num_parameters();
    last_error = found.square_error;
  }
  EXPECT_EQ(last, 0u);
}

}  // namespace
}  // namespace tomofield::compact
