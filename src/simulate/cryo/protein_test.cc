#include "simulate/cryo/protein.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tomofield::simulate {
namespace {

const ProteinKind kBarrel{"barrel", 720.0, 7, true, 25.7};
const ProteinKind kLump{"lump", 3200.0, 1, false, 50.0};

double potential_at(const std::vector<Gaussian>& gaussians, const Vector3& point) {
  double sum = 0.0;
  for (const Gaussian& g : gaussians) {
    const Vector3 d = moved(g.center_A, -1.0, point);
    sum += g.peak_V() * std::exp(-0.5 * dot(d, d) / (g.sigma_A * g.sigma_A));
  }
  return sum;
}

TEST(Protein, HasThePotentialOfItsMass) {
  for (const ProteinKind& kind : {kBarrel, kLump}) {
    double integral = 0.0;
    for (const Gaussian& g : make_protein(kind, base::Random(3))) integral += g.integral_VA3;
    EXPECT_NEAR(integral / (kind.mass_kDa * 1e3), 4.26, 1e-9) << kind.name;
  }
}

TEST(Protein, IsAsDenseInsideAsProtein) {
  for (const ProteinKind& kind : {kBarrel, kLump}) {
    const auto gaussians = make_protein(kind, base::Random(4));
    double mean = 0.0;
    for (const Gaussian& g : gaussians) mean += potential_at(gaussians, g.center_A);
    mean /= static_cast<double>(gaussians.size());
    EXPECT_GT(mean, 2.5) << kind.name;  // 3.46 V in the interior, less at the surface
    EXPECT_LT(mean, 4.5) << kind.name;
  }
}

TEST(Protein, IsCompact) {
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    const double radius = radius_A(make_protein(kLump, base::Random(seed)));
    EXPECT_GT(radius, protein_radius_A(kLump.mass_kDa));
    EXPECT_LT(radius, 2.0 * protein_radius_A(kLump.mass_kDa));
  }
}

TEST(Protein, LooksTheSameAfterEachOperationOfItsSymmetry) {
  const auto gaussians = make_protein(kBarrel, base::Random(5));
  const Vector3 point = moved(gaussians[0].center_A, 1.0, {3.0, -2.0, 4.0});
  const double expected = potential_at(gaussians, point);
  ASSERT_GT(expected, 0.5);
  for (int copy = 1; copy < kBarrel.copies(); ++copy)
    EXPECT_NEAR(potential_at(gaussians, symmetric_copy(kBarrel, copy, point)), expected, 1e-9);
  const Vector3 turned_by_half_a_step = symmetric_copy({"", 1.0, 14}, 1, point);
  EXPECT_GT(std::abs(potential_at(gaussians, turned_by_half_a_step) - expected), 0.01);
}

TEST(Protein, DiffersBetweenSeedsOnly) {
  const auto first = make_protein(kLump, base::Random(1));
  const auto again = make_protein(kLump, base::Random(1));
  const auto other = make_protein(kLump, base::Random(2));
  ASSERT_EQ(first.size(), again.size());
  EXPECT_EQ(first.back().center_A, again.back().center_A);
  EXPECT_NE(first.back().center_A, other.back().center_A);
}

}  // namespace
}  // namespace tomofield::simulate
