#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "base/random.h"
#include "io/images/image_stack.h"
#include "tilt_series/masks/beads.h"
#include "tomofield/options.h"

namespace tomofield::testing {

/// The position of a bead: relative to the middle of the view in x, and to the axis in z.
struct TrueBead {
  double x_px, y_px, z_px;
};

/// A made-up tilt series: soft round bodies and a straight edge that turn with the specimen, white
/// noise of deviation 1, and spheres of gold.
struct BeadScene {
  std::int64_t width = 160, height = 128;
  std::vector<double> tilt_deg;
  std::vector<TrueBead> beads;
  double diameter_px = 5.0;
  double contrast = 10.0;  ///< contrast of a bead's middle
  double specimen = 3.0;   ///< contrast of bodies and edge
  double noise = 1.0;

  BeadScene() {
    for (int i = -15; i <= 15; ++i) tilt_deg.push_back(4.0 * i);
  }

  double bead_x(const TrueBead& bead, std::size_t view) const {
    const double tilt = tilt_deg[view] * std::numbers::pi / 180.0;
    return static_cast<double>(width) / 2 + bead.x_px * std::cos(tilt) + bead.z_px * std::sin(tilt);
  }

  /// Scatters beads that are far enough apart to tell them from each other at zero tilt.
  void scatter_beads(int count, std::uint64_t seed) {
    base::Random random(seed);
    while (static_cast<int>(beads.size()) < count) {
      const TrueBead bead{random.uniform(-60, 60), random.uniform(8, 120), random.uniform(-25, 25)};
      const bool is_clear = std::all_of(beads.begin(), beads.end(), [&](const TrueBead& other) {
        return std::hypot(bead.x_px - other.x_px, bead.y_px - other.y_px) > 3 * diameter_px;
      });
      if (is_clear) beads.push_back(bead);
    }
  }

  void add_sphere(double x, double y, double height_at_centre,
                  tilt_series::MaskedImage* image) const {
    const double radius = diameter_px / 2;
    for (std::int64_t py = 0; py < height; ++py) {
      if (std::fabs(static_cast<double>(py) - y) > radius + 2) continue;
      for (std::int64_t px = 0; px < width; ++px) {
        const double r =
            std::hypot(static_cast<double>(px) + 0.5 - x, static_cast<double>(py) + 0.5 - y) /
            radius;
        if (r < 1) {
          image->values[image->index(px, py)] +=
              static_cast<float>(height_at_centre * std::sqrt(1 - r * r));
        }
      }
    }
  }

  double specimen_at(double x, double y, std::size_t view) const {
    const std::vector<TrueBead> bodies{{-40, 40, 5}, {10, 90, -10}, {45, 30, 0}, {-10, 60, 12}};
    double value = bead_x({50, 0, 0}, view) < x + 0.3 * y ? specimen : 0.0;
    for (const TrueBead& body : bodies) {
      const double r = std::hypot(x - bead_x(body, view), y - body.y_px) / 14.0;
      value += specimen * std::max(0.0, 1 - r * r);
    }
    return value;
  }

  tilt_series::MaskedImage view(std::size_t index) const {
    tilt_series::MaskedImage image(width, height);
    base::Random random(17, index);
    for (std::int64_t i = 0; i < width * height; ++i) {
      image.values[static_cast<std::size_t>(i)] = static_cast<float>(
          specimen_at(static_cast<double>(i % width), static_cast<double>(i / width), index) +
          noise * random.normal());
    }
    for (const TrueBead& bead : beads) add_sphere(bead_x(bead, index), bead.y_px, contrast, &image);
    return image;
  }

  tilt_series::BeadViews views() const {
    return {tilt_deg, [this](std::size_t index) { return view(index); }};
  }

  /// Returns the views as a stack in memory of 20 Å a pixel; dense parts are low in dark contrast.
  std::shared_ptr<const io::ImageStack> stack(Contrast looks) const {
    constexpr float kEmptyBeam = 50;
    std::vector<float> values;
    for (std::size_t index = 0; index < tilt_deg.size(); ++index) {
      for (const float value : view(index).values)
        values.push_back(looks == Contrast::kDark ? kEmptyBeam - value : value);
    }
    return io::image_stack_in_memory(std::move(values), width, height, tilt_deg,
                                     /*pixel_size_A=*/20.0);
  }
};

}  // namespace tomofield::testing
