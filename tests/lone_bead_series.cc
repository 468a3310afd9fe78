#include "lone_bead_series.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/random.h"
#include "simulate/project_phantom.h"

namespace tomofield::testing {
namespace {

constexpr double kSigma = 0.1;  // of the noise

}  // namespace

Bead::Bead(const std::array<double, 3>& center) : large(center), small(center) {
  const std::array<double, 3> direction = {0.64, -0.48, 0.6};
  for (std::size_t i = 0; i < 3; ++i) small[i] += (kLarge + kSmall) * direction[i];
}

double Bead::center_of_mass(std::size_t axis) const {
  const double a = std::pow(kLarge, 3), b = std::pow(kSmall, 3);
  return (a * large[axis] + b * small[axis]) / (a + b);
}

BeadSeries::BeadSeries(const geometry::TiltGeometry& geometry, const Bead& bead,
                       std::uint64_t noise_seed)
    : geometry_(geometry), bead_(bead), noise_seed_(noise_seed) {
  const measurement::SlabViews::Shape shape{
      .num_views = static_cast<std::size_t>(geometry.num_views()),
      .width = geometry.width,
      .height = geometry.height,
      .first_row = 0,
      .num_rows = geometry.height};
  const auto rays = std::make_shared<measurement::SlabViews>(
      shape, 1.0,
      [this](std::size_t v, std::span<float> image, std::span<std::uint8_t> valid) {
        read(v, image);
        std::fill(valid.begin(), valid.end(), std::uint8_t{1});
      },
      "/tmp");
  measurement_ = {.geometry = geometry,
                  .roi = {0, 0, geometry.width, geometry.height},
                  .rays = rays,
                  .noise_sigma = std::vector<double>(shape.num_views, kSigma),
                  .mean_density = 0.005};
}

void BeadSeries::read(std::size_t view, std::span<float> image) const {
  const geometry::TiltGeometry& g = geometry_;
  const auto relative = [&](const std::array<double, 3>& p) {
    return std::array{p[0] - g.axis_x, p[1] - static_cast<double>(g.height) / 2, p[2] - g.axis_z};
  };
  const std::vector<simulate::Ellipsoid> bodies = {
      simulate::make_sphere(relative(bead_.large), Bead::kLarge, 1.0),
      simulate::make_sphere(relative(bead_.small), Bead::kSmall, 1.0)};
  const auto exact = simulate::project_ellipsoids(
      bodies, {.width = g.width,
               .height = g.height,
               .tilt_deg = g.hand * g.tilt_deg[view],
               .raw_from_aligned = {.shift_x_px = g.axis_x - static_cast<double>(g.width) / 2}});
  base::Random random(noise_seed_, view);
  for (std::size_t i = 0; i < image.size(); ++i)
    image[i] = static_cast<float>(exact[i] + kSigma * random.normal());
}

std::vector<double> tilts(double from, double to, double step) {
  std::vector<double> result;
  for (double t = from; t <= to + 1e-9; t += step) result.push_back(t);
  return result;
}

FieldOptions small_field(FieldKind kind) {
  FieldOptions options;
  options.kind = kind;
  options.rank = 6;
  return options;
}

}  // namespace tomofield::testing
