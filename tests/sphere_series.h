#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/random.h"
#include "geometry/tilt_geometry.h"
#include "measurement/slab_views.h"
#include "simulate/project_phantom.h"

namespace tomofield::testing {

/// A noisy series of a few spheres in empty space, projected analytically. It is small enough for
/// unit tests. Its last slab is not full, and some of its pixels are no measurements.
class SphereSeries {
 public:
  struct Options {
    double noise_sigma = 0.3;
    float masked_value = 0.0f;          ///< value of the pixels where the mask is false
    std::vector<double> scale_of_view;  ///< gain of each view; empty: 1
  };
  static constexpr std::int64_t kWidth = 32, kRows = 21;
  static constexpr int kThickness = 20;

  SphereSeries() : SphereSeries(Options()) {}
  explicit SphereSeries(Options options) : options_(std::move(options)) {
    std::vector<double> tilts;
    for (double tilt = -60; tilt <= 60; tilt += 4) tilts.push_back(tilt);
    geometry = geometry::centred_geometry(kWidth, kRows, kThickness, tilts);
    noise_sigma.assign(tilts.size(), options_.noise_sigma);
    rays = std::make_shared<measurement::SlabViews>(
        measurement::SlabViews::Shape{.num_views = tilts.size(),
                                      .width = kWidth,
                                      .height = kRows,
                                      .first_row = 0,
                                      .num_rows = kRows},
        1.0,
        [this](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
          read(view, image, valid);
        },
        "/tmp");
  }

  /// Returns the density at a voxel's centre.
  static double truth(int x, int y, int z) {
    double density = 0;
    for (const simulate::Ellipsoid& s : spheres()) {
      density +=
          s.density(x + 0.5 - kWidth / 2.0 - s.center[0], y + 0.5 - kRows / 2.0 - s.center[1],
                    z + 0.5 - kThickness / 2.0 - s.center[2]);
    }
    return density;
  }

  geometry::TiltGeometry geometry;
  std::vector<double> noise_sigma;
  std::shared_ptr<const measurement::SlabViews> rays;

 private:
  static std::vector<simulate::Ellipsoid> spheres() {
    return {simulate::make_sphere({-4.2, -3.1, 1.3}, 5.1, 1.0),
            simulate::make_sphere({5.3, 5.4, -2.2}, 4.2, 0.6),
            simulate::make_sphere({7.1, -5.7, 3.9}, 2.7, 0.8)};
  }

  void read(std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) const {
    const auto exact = project_ellipsoids(
        spheres(), {.width = kWidth, .height = kRows, .tilt_deg = geometry.tilt_deg[view]});
    const double scale = options_.scale_of_view.empty() ? 1.0 : options_.scale_of_view[view];
    base::Random random(5, view);
    for (std::size_t i = 0; i < image.size(); ++i) {
      image[i] = static_cast<float>(scale * exact[i] + options_.noise_sigma * random.normal());
      valid[i] = random.uniform() < 0.97;
      if (valid[i] == 0) image[i] = options_.masked_value;
    }
  }

  Options options_;
};

}  // namespace tomofield::testing
