#pragma once

#include <cstdint>
#include <vector>

namespace tomofield::report {

/// Densities to greys: 0.5 and 99.5 percentiles of a sample are black and white.
class GreyScale {
 public:
  /// Values that are not finite do not count; of none, everything is black.
  explicit GreyScale(std::vector<float> sample);
  /// 0 … 255; NaN is black.
  std::uint8_t grey(double value) const;

 private:
  double black_ = 0.0, to_grey_ = 0.0;
};

/// Whole pixels a voxel so that pictures of small volumes are at least 512 wide,
/// unless another would then be wider than 4096.
std::int64_t picture_zoom(std::int64_t narrowest, std::int64_t widest);

}  // namespace tomofield::report
