#include "simulate/textured_content.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/check.h"
#include "base/random.h"
#include "simulate/random_ellipsoid.h"
#include "simulate/vesicles.h"

namespace tomofield::simulate {
namespace {

constexpr std::uint64_t kIceStream = 5;
constexpr std::uint64_t kVesicleStream = 6;
constexpr std::uint64_t kFilamentStream = 7;
constexpr std::uint64_t kParticleStream = 8;
// The content goes on this far beyond the field of view in Y, so that shifted views see it.
constexpr double kBeyondField = 24.0;
constexpr double kVoxelsPerFilament = 100'000.0;
constexpr double kLatticeSpacing = 20.0;

// Returns half of the lengths of the box that filaments and particles fill.
Vector3 half_extent(const Phantom& phantom) {
  return {phantom.half_width_px, static_cast<double>(phantom.shape.ny) / 2.0 + kBeyondField,
          static_cast<double>(phantom.shape.nz) / 2.0};
}

Vector3 random_point(const Vector3& half, base::Random& random) {
  Vector3 p;
  for (std::size_t i = 0; i < 3; ++i) p[i] = random.uniform(-half[i], half[i]);
  return p;
}

void add_ice_gradients(base::Random random, Phantom& phantom) {
  const double thickness = static_cast<double>(phantom.shape.nz);
  Vector3 half = half_extent(phantom);
  half[1] = static_cast<double>(phantom.shape.ny) / 2.0 + thickness;
  const auto count =
      static_cast<int>(std::llround(6.0 * 4.0 * half[0] * half[1] / (thickness * thickness)));
  for (int i = 0; i < count; ++i) {
    const Vector3 center = random_point(half, random);
    const double sigma = random.uniform(0.15, 0.4) * thickness;
    phantom.blobs.push_back(
        {.center = center, .sigma = sigma, .peak = random.uniform(-0.06, 0.06)});
  }
}

// Places filaments and particles where they touch neither membranes nor the faces of the slab.
class FreeSpace {
 public:
  FreeSpace(const Vector3& half, const std::vector<Vesicle>& vesicles)
      : half_(half), vesicles_(vesicles) {}

  const Vector3& half() const { return half_; }

  bool holds(const Vector3& position, double radius) const {
    return std::abs(position[0]) <= half_[0] && std::abs(position[1]) <= half_[1] &&
           std::abs(position[2]) + radius <= half_[2] &&
           is_clear_of_membranes(vesicles_, position, radius);
  }

 private:
  Vector3 half_;
  const std::vector<Vesicle>& vesicles_;
};

// Draws a direction that lies more along the slab than across it.
Vector3 direction_along_slab(base::Random& random) {
  Vector3 direction = random_direction(random);
  direction[2] *= 0.25;
  return normalized(direction);
}

// Returns the blobs of a filament from a random point with space on, for as long as there is space.
std::vector<Blob> random_filament(const FreeSpace& space, base::Random& random) {
  constexpr double kSigma = 1.3, kClearance = 7.0;
  constexpr int kTries = 20;
  Vector3 at = random_point(space.half(), random);
  for (int i = 1; i < kTries && !space.holds(at, kClearance); ++i)
    at = random_point(space.half(), random);
  Vector3 direction = direction_along_slab(random), turn = direction_along_slab(random);
  const double curvature = random.below(2) == 0 ? 0.0 : random.uniform(0.004, 0.02);
  const auto most = static_cast<std::size_t>(random.uniform(60.0, 250.0) / kSigma);
  // Blobs σ apart add up to √(2π) times the peak of one, without ripples.
  const double peak = random.uniform(0.2, 0.35) / std::sqrt(2.0 * std::numbers::pi);
  std::vector<Blob> filament;
  while (filament.size() < most && space.holds(at, kClearance)) {
    filament.push_back({.center = at, .sigma = kSigma, .peak = peak});
    turn = normalized(moved(turn, 0.15, direction_along_slab(random)));
    direction = normalized(moved(direction, curvature * kSigma, turn));
    at = moved(at, kSigma, direction);
  }
  const double length = kSigma * static_cast<double>(filament.size());
  return length < 24.0 ? std::vector<Blob>() : filament;
}

void add_filaments(const FreeSpace& space, base::Random random, Phantom& phantom) {
  const Vector3& half = space.half();
  const auto tries = std::llround(8.0 * half[0] * half[1] * half[2] / kVoxelsPerFilament);
  for (std::int64_t i = 0; i < tries; ++i) {
    const auto filament = random_filament(space, random);
    phantom.blobs.insert(phantom.blobs.end(), filament.begin(), filament.end());
  }
}

// Returns what a cell of the lattice about `center` holds.
std::vector<Blob> random_particles(const Vector3& center, base::Random& random) {
  std::vector<Blob> blobs;
  const auto kind = random.below(3);
  if (kind == 0) {
    const double sigma = random.uniform(3.0, 6.0);
    blobs.push_back({.center = center, .sigma = sigma, .peak = random.uniform(0.15, 0.3)});
  } else if (kind == 1) {
    const double sigma = random.uniform(1.5, 3.0), peak = random.uniform(0.15, 0.25);
    const auto count = 3 + random.below(3);
    while (blobs.size() < count) {
      const double distance = random.uniform(1.8, 2.5) * sigma;
      blobs.push_back({.center = moved(center, distance, random_direction(random)),
                       .sigma = sigma,
                       .peak = peak});
    }
  } else {
    while (blobs.size() < 3) {
      const double sigma = random.uniform(1.5, 2.0), distance = random.uniform(4.0, 9.0);
      blobs.push_back({.center = moved(center, distance, random_direction(random)),
                       .sigma = sigma,
                       .peak = random.uniform(0.2, 0.4)});
    }
  }
  return blobs;
}

void add_particles(const FreeSpace& space, base::Random random, Phantom& phantom) {
  const Vector3& half = space.half();
  std::array<std::int64_t, 3> count;
  Vector3 spacing;
  for (std::size_t i = 0; i < 3; ++i) {
    count[i] = std::max<std::int64_t>(std::llround(2.0 * half[i] / kLatticeSpacing), 1);
    spacing[i] = 2.0 * half[i] / static_cast<double>(count[i]);
  }
  for (std::int64_t cell = 0; cell < count[0] * count[1] * count[2]; ++cell) {
    const std::array<std::int64_t, 3> at = {cell % count[0], cell / count[0] % count[1],
                                            cell / (count[0] * count[1])};
    if (random.uniform() < 0.3) continue;
    Vector3 center;
    for (std::size_t i = 0; i < 3; ++i)
      center[i] = (static_cast<double>(at[i]) + random.uniform()) * spacing[i] - half[i];
    for (const Blob& blob : random_particles(center, random))
      if (space.holds(blob.center, 2.0 * blob.sigma)) phantom.blobs.push_back(blob);
  }
}

}  // namespace

void add_textured_content(std::uint64_t seed, Phantom& phantom) {
  TOMOFIELD_CHECK(phantom.is_extended, "the content continues outside the field of view");
  add_ice_gradients(base::Random(seed, kIceStream), phantom);
  const auto vesicles = place_vesicles(base::Random(seed, kVesicleStream), phantom);
  const FreeSpace space(half_extent(phantom), vesicles);
  add_filaments(space, base::Random(seed, kFilamentStream), phantom);
  add_particles(space, base::Random(seed, kParticleStream), phantom);
  const double half_height = half_extent(phantom)[1];
  std::erase_if(phantom.blobs, [&](const Blob& blob) {  // no view sees these
    return std::abs(blob.center[1]) > half_height + blob.reach();
  });
}

}  // namespace tomofield::simulate
