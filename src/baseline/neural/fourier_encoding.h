#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "baseline/neural/point_encoding.h"

namespace tomofield::baseline {

/// Encodes a point by random Fourier features (Rahimi and Recht 2007; Tancik et al. 2020): plane
/// waves
///   sin(2π (b · point + φ))
/// of random phase φ and random direction. The frequency |b| is uniform up to 1 / `shortest`
/// pixels. The waves are fixed: there are no parameters.
class FourierEncoding final : public PointEncoding {
 public:
  FourierEncoding(int num_features, double shortest, std::uint64_t seed);
  int num_features() const override { return static_cast<int>(phase_.size()); }
  void encode(std::span<const Point> points, std::span<const float> parameters,
              float* features) const override;

 private:
  std::vector<float> x_, y_, z_, phase_;  // cycles a pixel, cycles
};

}  // namespace tomofield::baseline
