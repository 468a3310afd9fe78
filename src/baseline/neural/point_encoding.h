#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace tomofield::baseline {

/// A position (x, y, z) in pixels. It is also the size of the box that positions lie in, from 0 on.
using Point = std::array<float, 3>;

/// The features of a position that a network receives. Some encodings have parameters, which are
/// fitted too.
class PointEncoding {
 public:
  virtual ~PointEncoding() = default;
  virtual int num_features() const = 0;
  virtual std::size_t num_parameters() const { return 0; }
  virtual void initialize(std::uint64_t /*seed*/, std::span<float> /*parameters*/) const {}
  /// Computes the features [point, feature].
  virtual void encode(std::span<const Point> points, std::span<const float> parameters,
                      float* features) const = 0;
  /// Adds the gradient of Σ grad_features · features to grad_parameters, on all threads. The result
  /// has the same bits for any number of threads.
  virtual void accumulate(std::span<const Point> /*points*/, const float* /*grad_features*/,
                          std::span<float> /*grad_parameters*/) const {}
};

}  // namespace tomofield::baseline
