#include "evaluate/matching/template_match.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evaluate/matching/picks.h"
#include "random_arrays.h"

namespace tomofield::evaluate {
namespace {

using Position = std::array<double, 3>;

// Adds a lopsided particle of three Gaussians, turned about its centre.
void add_particle(const Position& centre, const field::Rotation& rotation, base::Volume& volume) {
  constexpr std::array<Position, 3> kParts{{{3.0, 0.0, 0.0}, {-2.0, 2.5, 0.0}, {-1.0, -1.5, 3.0}}};
  for (const Position& part : kParts) {
    Position at = centre;
    for (std::size_t row = 0; row < 3; ++row)
      for (std::size_t a = 0; a < 3; ++a) at[row] += rotation[row][a] * part[a];
    const base::Shape3& n = volume.shape;
    for (std::int64_t z = 0; z < n.nz; ++z)
      for (std::int64_t y = 0; y < n.ny; ++y)
        for (std::int64_t x = 0; x < n.nx; ++x) {
          const double squared = std::pow(static_cast<double>(x) + 0.5 - at[0], 2) +
                                 std::pow(static_cast<double>(y) + 0.5 - at[1], 2) +
                                 std::pow(static_cast<double>(z) + 0.5 - at[2], 2);
          volume.at(x, y, z) += static_cast<float>(std::exp(-squared / 3.0));
        }
  }
}

base::Volume reference() {
  base::Volume volume({16, 16, 16}, 20.0);
  add_particle({8, 8, 8}, field::kNoRotation, volume);
  return volume;
}

double turn_between_deg(const field::Rotation& a, const field::Rotation& b) {
  double trace = 0.0;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) trace += a[i][j] * b[i][j];
  return std::acos(std::clamp((trace - 1.0) / 2.0, -1.0, 1.0)) * 180.0 / std::numbers::pi;
}

TEST(EvenRotations, AreRotationsThatLeaveNoLargeGap) {
  const auto rotations = even_rotations(96);
  ASSERT_EQ(rotations.size(), 96u);
  double widest_deg = 0.0;
  base::Random random(3);
  for (int i = 0; i < 500; ++i) {
    const field::Rotation any = field::rotation_from_euler(
        random.uniform(0, 360), std::acos(random.uniform(-1, 1)) * 57.29578,
        random.uniform(0, 360));
    double nearest_deg = 360.0;
    for (const field::Rotation& r : rotations)
      nearest_deg = std::min(nearest_deg, turn_between_deg(r, any));
    widest_deg = std::max(widest_deg, nearest_deg);
  }
  EXPECT_LT(widest_deg, 55.0);
}

TEST(TemplateMatcher, IsOneAtTheParticleInTheRightOrientationAndLessElsewhere) {
  const field::Rotation rotation = even_rotations(96)[17];
  base::Volume volume({32, 36, 40}, 20.0);
  add_particle({13.5, 20.5, 22.5}, rotation, volume);
  for (float& value : volume.data) value = 5.0f * value - 2.0f;
  const TemplateMatcher matcher(volume, 6.0);
  const base::Volume right = matcher.correlate(reference(), {rotation, field::kNoRotation});
  EXPECT_GT(right.at(13, 20, 22), 0.97f);
  EXPECT_LE(right.at(13, 20, 22), 1.001f);
  EXPECT_LT(right.at(13, 20, 29), 0.6f);
  const base::Volume wrong = matcher.correlate(reference(), {field::kNoRotation});
  EXPECT_LT(wrong.at(13, 20, 22), 0.8f);
}

TEST(FindPicks, ReturnsMaximaThatAreApartFromTheHighestDown) {
  base::Volume correlation({20, 20, 20});
  correlation.at(5, 5, 5) = 0.9f;
  correlation.at(7, 5, 5) = 0.8f;  // too near to the first
  correlation.at(14, 14, 14) = 0.7f;
  correlation.at(1, 10, 10) = 0.95f;  // in the margin
  for (float& value : correlation.data) value -= 1e-3f;
  const auto picks = find_picks(correlation, 4.0, 3.0, 2);
  ASSERT_EQ(picks.size(), 2u);
  EXPECT_EQ(picks[0].position_px, (Position{5.5, 5.5, 5.5}));
  EXPECT_EQ(picks[1].position_px, (Position{14.5, 14.5, 14.5}));
}

TEST(PickScore, FindsParticlesInACleanVolumeAndMissesThemInNoise) {
  base::Volume volume({64, 64, 32}, 20.0);
  const std::vector<Position> places{{14, 14, 14}, {40, 15, 18}, {20, 44, 15}, {48, 48, 16}};
  base::Random random(9);
  for (const Position& place : places)
    add_particle(place, field::rotation_from_euler(random.uniform(0, 360), 70, 40), volume);
  const ParticleReference particle{"test", reference(), places};
  EXPECT_GT(pick_score(volume, particle).average_precision, 0.99);
  EXPECT_EQ(pick_score(volume, particle).num_particles, 4);
  base::Volume noise(volume.shape, 20.0);
  noise.data = testing::random_floats(noise.data.size(), 6);
  EXPECT_LT(pick_score(noise, particle).average_precision, 0.3);
}

}  // namespace
}  // namespace tomofield::evaluate
