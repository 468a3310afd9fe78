#include "simulate/cryo/specimen.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "field/sampling/sample_box.h"
#include "simulate/cryo/particle_files.h"
#include "simulate/rasterize.h"

namespace tomofield::simulate {
namespace {

CellOptions small_field() {
  CellOptions options;
  options.content = Content::kCryo;
  options.size_px = 96;
  options.thickness_px = 56;
  options.is_extended = true;
  options.max_tilt_deg = 60.0;
  options.seed = 11;
  return options;
}

constexpr double kVoxel_A = 20.0;

// Returns the blobs of a phantom near a position, without the faces of the slab.
Phantom near(const Phantom& phantom, const Vector3& position, double reach) {
  Phantom part;
  part.shape = {1000, 1000, 1000};
  for (const Blob& blob : phantom.blobs) {
    const Vector3 d = moved(blob.center, -1.0, position);
    if (dot(d, d) < reach * reach) part.blobs.push_back(blob);
  }
  return part;
}

// Returns Pearson's correlation of a turned reference with the specimen where the particle is.
double correlation_with(const CryoSpecimen& specimen, const base::Volume& reference,
                        const PlacedParticle& particle) {
  const auto [rot, tilt, psi] = particle.euler_deg;
  const field::Rotation rotation = field::rotation_from_euler(rot, tilt, psi);
  const auto half = static_cast<double>(reference.shape.nx) / 2.0;
  const Phantom part = near(specimen.phantom, particle.center_px, 2.0 * half);
  double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  for (std::int64_t z = 0; z < reference.shape.nz; ++z)
    for (std::int64_t y = 0; y < reference.shape.ny; ++y)
      for (std::int64_t x = 0; x < reference.shape.nx; ++x) {
        const Vector3 r{static_cast<double>(x) + 0.5 - half, static_cast<double>(y) + 0.5 - half,
                        static_cast<double>(z) + 0.5 - half};
        if (reference.at(x, y, z) < 0.5f) continue;  // neighbours may be beside the particle
        Vector3 at = particle.center_px;
        for (std::size_t row = 0; row < 3; ++row)
          for (std::size_t column = 0; column < 3; ++column)
            at[row] += rotation[row][column] * r[column];
        const double u = static_cast<double>(reference.at(x, y, z));
        const double v = density_at(part, at[0], at[1], at[2]);
        n += 1, a += u, b += v, aa += u * u, bb += v * v, ab += u * v;
      }
  return (ab - a * b / n) / std::sqrt((aa - a * a / n) * (bb - b * b / n));
}

class CryoSpecimenTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    specimen_ = new CryoSpecimen(make_cryo_specimen(small_field(), kVoxel_A));
  }
  static void TearDownTestSuite() { delete specimen_; }
  static const CryoSpecimen* specimen_;
};

const CryoSpecimen* CryoSpecimenTest::specimen_ = nullptr;

TEST_F(CryoSpecimenTest, HasAllKindsInsideAndOutsideOfTheField) {
  std::set<std::size_t> kinds;
  int outside = 0;
  for (const PlacedParticle& p : specimen_->particles) {
    kinds.insert(p.kind);
    outside += std::abs(p.center_px[0]) > 48.0 ? 1 : 0;
  }
  EXPECT_EQ(kinds.size(), specimen_->kinds.size());
  EXPECT_GT(outside, static_cast<int>(specimen_->particles.size()) / 3);
}

// The truth around a particle correlates with the particle's turned reference, and not with the
// same reference in another orientation.
TEST_F(CryoSpecimenTest, ParticlesAreWhereTheListSaysInTheirOrientation) {
  const auto ribosome = std::ranges::find(specimen_->kinds, "ribosome", &ParticleKind::name);
  ASSERT_NE(ribosome, specimen_->kinds.end());
  const base::Volume reference = reference_density(*ribosome, kVoxel_A);
  int tested = 0;
  for (const PlacedParticle& p : specimen_->particles) {
    if (&specimen_->kinds[p.kind] != &*ribosome || std::abs(p.center_px[0]) > 40.0) continue;
    if (++tested > 5) break;
    const auto own = correlation_with(*specimen_, reference, p);
    PlacedParticle turned = p;
    turned.euler_deg[1] += 90.0;
    const auto other = correlation_with(*specimen_, reference, turned);
    EXPECT_GT(own, 0.97);
    EXPECT_LT(other, own - 0.05);
  }
  EXPECT_GT(tested, 0);
}

TEST_F(CryoSpecimenTest, MembraneLabelCoversWhatIsWithin25A) {
  const base::Volume label = membrane_label(*specimen_, kVoxel_A);
  double inside = 0.0;
  for (const float value : label.data) {
    ASSERT_TRUE(value == 0.0f || value == 1.0f);
    inside += static_cast<double>(value);
  }
  // The points stand for 11 × 11 Å² of a sheet of 50 Å; some lie outside of the field.
  const auto& shape = label.shape;
  double points = 0.0;
  for (const Vector3& p : specimen_->membrane_points_px)
    if (std::abs(p[0]) < 0.5 * static_cast<double>(shape.nx) &&
        std::abs(p[1]) < 0.5 * static_cast<double>(shape.ny))
      points += 1.0;
  const double volume_px = points * 11.0 * 11.0 * 50.0 / std::pow(kVoxel_A, 3);
  EXPECT_GT(points, 1000.0);
  EXPECT_NEAR(inside / volume_px, 1.0, 0.25);  // semi-axes differ by up to a fifth
}

TEST_F(CryoSpecimenTest, IsMadeByItsSeed) {
  const CryoSpecimen again = make_cryo_specimen(small_field(), kVoxel_A);
  ASSERT_EQ(again.phantom.blobs.size(), specimen_->phantom.blobs.size());
  EXPECT_EQ(again.phantom.blobs.back().center, specimen_->phantom.blobs.back().center);
  CellOptions other = small_field();
  other.seed = 12;
  EXPECT_NE(make_cryo_specimen(other, kVoxel_A).phantom.blobs.size(), again.phantom.blobs.size());
}

}  // namespace
}  // namespace tomofield::simulate
