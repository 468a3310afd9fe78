#include "baseline/neural/fourier_encoding.h"

#include <cmath>

#include "base/random.h"
#include "baseline/neural/fast_sine.h"

namespace tomofield::baseline {

FourierEncoding::FourierEncoding(int num_features, double shortest, std::uint64_t seed) {
  base::Random random(seed);
  for (int i = 0; i < num_features; ++i) {
    const double frequency = random.uniform() / shortest;
    const double b[] = {random.normal(), random.normal(), random.normal()};
    const double scale = frequency / std::hypot(b[0], b[1], b[2]);
    x_.push_back(static_cast<float>(scale * b[0]));
    y_.push_back(static_cast<float>(scale * b[1]));
    z_.push_back(static_cast<float>(scale * b[2]));
    phase_.push_back(static_cast<float>(random.uniform()));
  }
}

void FourierEncoding::encode(std::span<const Point> points, std::span<const float>,
                             float* features) const {
  const std::size_t count = phase_.size();
  for (const auto& [x, y, z] : points) {
    for (std::size_t i = 0; i < count; ++i)
      features[i] = sine_of_cycles(x_[i] * x + y_[i] * y + z_[i] * z + phase_[i]);
    features += count;
  }
}

}  // namespace tomofield::baseline
