#pragma once

#include <cstdint>
#include <vector>

namespace tomofield::report {

/// Maps densities to greys. The 0.5 and 99.5 percentiles of a sample are black and white.
class GreyScale {
 public:
  /// Takes the scale from the finite values of a sample. If there are none, everything is black.
  explicit GreyScale(std::vector<float> sample);
  /// Returns the grey of a value, from 0 to 255. NaN is black.
  std::uint8_t grey(double value) const;

 private:
  double black_ = 0.0, to_grey_ = 0.0;
};

/// Returns the pixels a voxel at which pictures of small volumes are at least 512 wide, unless
/// another would then be wider than 4096.
std::int64_t picture_zoom(std::int64_t narrowest, std::int64_t widest);

}  // namespace tomofield::report
