#include "evaluate/matching/template_match.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "evaluate/resolution/fsc.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

using Spectrum = std::vector<std::complex<float>>;
using Vector = std::array<double, 3>;

// Undoes transform_volume().
void inverse_transform(const base::Shape3& shape, Spectrum& values) {
  const float scale = 1.0f / static_cast<float>(shape.voxels());
  for (auto& value : values) value = std::conj(value);
  transform_volume(shape, values);
  for (auto& value : values) value = scale * std::conj(value);
}

// Calls visit(offset, index) for all whole offsets within a radius of a voxel at the origin of a
// periodic volume.
template <typename Visit>
void visit_sphere(const base::Shape3& shape, double radius, const Visit& visit) {
  const auto reach = static_cast<std::int64_t>(std::floor(radius));
  const auto wrapped = [](std::int64_t i, std::int64_t n) { return (i + n) % n; };
  for (std::int64_t z = -reach; z <= reach; ++z)
    for (std::int64_t y = -reach; y <= reach; ++y)
      for (std::int64_t x = -reach; x <= reach; ++x) {
        const Vector offset{static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)};
        if (static_cast<double>(x * x + y * y + z * z) > radius * radius) continue;
        visit(offset, static_cast<std::size_t>(
                          (wrapped(z, shape.nz) * shape.ny + wrapped(y, shape.ny)) * shape.nx +
                          wrapped(x, shape.nx)));
      }
}

// Returns a volume at a place that counts voxels from the centre of voxel 0; 0 outside.
double linear_value(const base::Volume& volume, const Vector& at) {
  std::array<std::int64_t, 3> low{};
  Vector part{};
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = static_cast<std::int64_t>(std::floor(at[a]));
    part[a] = at[a] - static_cast<double>(low[a]);
  }
  const base::Shape3& n = volume.shape;
  double sum = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const std::int64_t x = low[0] + (corner & 1), y = low[1] + (corner >> 1 & 1),
                       z = low[2] + (corner >> 2);
    if (x < 0 || y < 0 || z < 0 || x >= n.nx || y >= n.ny || z >= n.nz) continue;
    const double weight = ((corner & 1) != 0 ? part[0] : 1.0 - part[0]) *
                          ((corner & 2) != 0 ? part[1] : 1.0 - part[1]) *
                          ((corner & 4) != 0 ? part[2] : 1.0 - part[2]);
    sum += weight * static_cast<double>(volume.at(x, y, z));
  }
  return sum;
}

}  // namespace

std::vector<field::Rotation> even_rotations(int count) {
  constexpr double kPsi = 1.533751168755204288118041;  // psi⁴ = psi + 4
  std::vector<field::Rotation> rotations;
  for (int i = 0; i < count; ++i) {
    const double s = i + 0.5;
    const double t = s / count;
    const double a = 2.0 * std::numbers::pi * s / std::numbers::sqrt2;
    const double b = 2.0 * std::numbers::pi * s / kPsi;
    const double x = std::sqrt(t) * std::sin(a), y = std::sqrt(t) * std::cos(a);
    const double z = std::sqrt(1.0 - t) * std::sin(b), w = std::sqrt(1.0 - t) * std::cos(b);
    rotations.push_back({{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                          {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                          {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}}});
  }
  return rotations;
}

TemplateMatcher::TemplateMatcher(const base::Volume& volume, double radius_px)
    : shape_(volume.shape), voxel_size_A_(volume.voxel_size_A), radius_px_(radius_px) {
  const double shortest = static_cast<double>(std::min({shape_.nx, shape_.ny, shape_.nz}));
  if (shortest <= 2.0 * radius_px + 1.0)
    throw Error(fmt::format(
        "the volume has {} voxels along its shortest axis: too few to look for particles of a "
        "radius of {:.1f} voxels",
        shortest, radius_px));
  // Three spectra, a copy within the transform, and the deviations.
  constexpr std::size_t kBytesOfVoxel = 4 * sizeof(std::complex<float>) + sizeof(float);
  base::require_memory(kBytesOfVoxel * shape_.voxels(), "the search for particles",
                       "cut a part out of the volume");
  Spectrum sphere(shape_.voxels());
  double count = 0.0;
  visit_sphere(shape_, radius_px, [&](const Vector&, std::size_t i) {
    sphere[i] = 1.0f;
    count += 1.0;
  });
  transform_volume(shape_, sphere);
  // The means within the sphere of the volume and of its square, as one complex volume. The mean of
  // the whole volume is taken off, because squares would round it away.
  double mean = 0.0;
  for (const float v : volume.data) mean += static_cast<double>(v);
  mean /= static_cast<double>(shape_.voxels());
  spectrum_.resize(shape_.voxels());
  Spectrum local(shape_.voxels());
  double power = 0.0;
  for (std::size_t i = 0; i < local.size(); ++i) {
    const auto v = static_cast<float>(static_cast<double>(volume.data[i]) - mean);
    spectrum_[i] = v;
    local[i] = {v, v * v};
    power += static_cast<double>(v * v);
  }
  transform_volume(shape_, spectrum_);
  transform_volume(shape_, local);
  for (std::size_t i = 0; i < local.size(); ++i) local[i] *= std::conj(sphere[i]);
  inverse_transform(shape_, local);
  // Where nothing is, rounding must not count as structure.
  const double least = 1e-4 * power / static_cast<double>(shape_.voxels());
  deviation_.resize(shape_.voxels());
  for (std::size_t i = 0; i < local.size(); ++i) {
    const double m = static_cast<double>(local[i].real()) / count;
    const double variance = static_cast<double>(local[i].imag()) / count - m * m;
    deviation_[i] = static_cast<float>(std::sqrt(std::max(variance, least)));
  }
}

// Adds the turned reference, less its mean, divided by its length within the sphere.
void TemplateMatcher::add_template(const base::Volume& reference, const field::Rotation& rotation,
                                   std::complex<float> factor, Spectrum& sum) const {
  const double centre = static_cast<double>(reference.shape.nx) / 2.0 - 0.5;
  std::vector<std::pair<std::size_t, double>> values;
  double mean = 0.0;
  visit_sphere(shape_, radius_px_, [&](const Vector& offset, std::size_t i) {
    Vector at{centre, centre, centre};
    for (std::size_t row = 0; row < 3; ++row)
      for (std::size_t a = 0; a < 3; ++a) at[a] += rotation[row][a] * offset[row];
    values.emplace_back(i, linear_value(reference, at));
    mean += values.back().second;
  });
  mean /= static_cast<double>(values.size());
  double squares = 0.0;
  for (auto& [i, value] : values) {
    value -= mean;
    squares += value * value;
  }
  if (!(squares > 0.0))
    throw Error("the reference of a particle is constant: there is nothing to look for");
  const double scale = 1.0 / std::sqrt(squares * static_cast<double>(values.size()));
  for (const auto& [i, value] : values) sum[i] += factor * static_cast<float>(scale * value);
}

base::Volume TemplateMatcher::correlate(const base::Volume& reference,
                                        const std::vector<field::Rotation>& rotations) const {
  base::Volume best(shape_, voxel_size_A_);
  std::ranges::fill(best.data, -1.0f);
  Spectrum pair;
  // Two real templates go through each transform, as a − i b, whose conjugate spectrum is that of
  // correlations with a and, times i, with b.
  for (std::size_t r = 0; r < rotations.size(); r += 2) {
    pair.assign(shape_.voxels(), {});
    const bool has_second = r + 1 < rotations.size();
    add_template(reference, rotations[r], 1.0f, pair);
    add_template(reference, rotations[has_second ? r + 1 : r], {0.0f, -1.0f}, pair);
    transform_volume(shape_, pair);
    for (std::size_t i = 0; i < pair.size(); ++i) pair[i] = spectrum_[i] * std::conj(pair[i]);
    inverse_transform(shape_, pair);
    for (std::size_t i = 0; i < pair.size(); ++i)
      best.data[i] =
          std::max(best.data[i], std::max(pair[i].real(), pair[i].imag()) / deviation_[i]);
  }
  return best;
}

std::vector<Pick> find_picks(const base::Volume& correlation, double distance_px, double margin_px,
                             std::size_t most) {
  const base::Shape3& n = correlation.shape;
  const auto margin = static_cast<std::int64_t>(std::ceil(std::max(margin_px, 1.0)));
  const auto is_maximum = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
    const float value = correlation.at(x, y, z);
    for (std::int64_t i = 0; i < 27; ++i)
      if (correlation.at(x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1) > value) return false;
    return true;
  };
  std::vector<Pick> maxima;
  for (std::int64_t z = margin; z < n.nz - margin; ++z)
    for (std::int64_t y = margin; y < n.ny - margin; ++y)
      for (std::int64_t x = margin; x < n.nx - margin; ++x)
        if (is_maximum(x, y, z))
          maxima.push_back({{static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5,
                             static_cast<double>(z) + 0.5},
                            correlation.at(x, y, z)});
  std::ranges::stable_sort(maxima, std::greater<>(), &Pick::correlation);
  std::vector<Pick> picks;
  for (const Pick& maximum : maxima) {
    if (picks.size() == most) break;
    const bool is_new = std::ranges::none_of(picks, [&](const Pick& pick) {
      double squared = 0.0;
      for (std::size_t a = 0; a < 3; ++a)
        squared += std::pow(pick.position_px[a] - maximum.position_px[a], 2);
      return squared < distance_px * distance_px;
    });
    if (is_new) picks.push_back(maximum);
  }
  return picks;
}

}  // namespace tomofield::evaluate
