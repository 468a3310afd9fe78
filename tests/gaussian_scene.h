#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "base/random.h"

namespace tomofield::testing {

/// Holds Gaussians at random places in space. Their projections are Gaussians as well.
class GaussianScene {
 public:
  /// Places Gaussians in a box whose half sides along X, Y and Z are given.
  GaussianScene(int count, const std::array<double, 3>& half_box) {
    base::Random random(11);
    for (int i = 0; i < count; ++i) {
      blobs_.push_back({.x = random.uniform(-half_box[0], half_box[0]),
                        .y = random.uniform(-half_box[1], half_box[1]),
                        .z = random.uniform(-half_box[2], half_box[2]),
                        .sigma = random.uniform(2.0, 4.0),
                        .peak = random.uniform(0.5, 1.5)});
    }
  }
  /// Returns the projection at (x, y), relative to the projected centre of the box, with hand +1.
  double projection(double x, double y, double tilt_deg) const {
    const double tilt = tilt_deg * std::numbers::pi / 180;
    double sum = 0.0;
    for (const Blob& blob : blobs_) {
      const double at = blob.x * std::cos(tilt) + blob.z * std::sin(tilt);
      const double square = std::pow(x - at, 2) + std::pow(y - blob.y, 2);
      const double exponent = -0.5 * square / (blob.sigma * blob.sigma);
      if (exponent > -25) sum += blob.peak * std::exp(exponent);  // the rest is below 2e-11
    }
    return sum;
  }

 private:
  struct Blob {
    double x, y, z, sigma, peak;
  };
  std::vector<Blob> blobs_;
};

}  // namespace tomofield::testing
