#pragma once

#include <cstddef>
#include <vector>

namespace tomofield::microscope {

/// A smooth function on an interval as values at equal distances, which is much faster than the
/// function itself where it is needed for every pixel.
class InterpolatedTable {
 public:
  /// Takes the values of `function` at `num_steps` + 1 places from 0 to `end`.
  template <typename Function>
  InterpolatedTable(double end, std::size_t num_steps, const Function& function)
      : steps_per_unit_(static_cast<double>(num_steps) / end) {
    values_.reserve(num_steps + 2);
    for (std::size_t i = 0; i <= num_steps; ++i)
      values_.push_back(static_cast<float>(function(static_cast<double>(i) / steps_per_unit_)));
    values_.push_back(values_.back());  // rounding may take `end` for a place behind it
  }

  /// Interpolates linearly at a place from 0 to the end.
  float operator()(double at) const {
    const double steps = at * steps_per_unit_;
    const auto i = static_cast<std::size_t>(steps);
    const auto part = static_cast<float>(steps - static_cast<double>(i));
    return values_[i] + part * (values_[i + 1] - values_[i]);
  }

 private:
  double steps_per_unit_;
  std::vector<float> values_;
};

}  // namespace tomofield::microscope
