#include "microscope/detector.h"

#include <algorithm>
#include <cstddef>

namespace tomofield::microscope {

double Detector::transfer(double k) const {
  const auto& [frequencies, values] = mtf;
  const double frequency = k * pixel_size_A;
  const auto after = std::ranges::upper_bound(frequencies, frequency);
  if (after == frequencies.begin()) return values.front();
  if (after == frequencies.end()) return values.back();
  const auto i = static_cast<std::size_t>(after - frequencies.begin());
  const double part = (frequency - frequencies[i - 1]) / (frequencies[i] - frequencies[i - 1]);
  return values[i - 1] + part * (values[i] - values[i - 1]);
}

}  // namespace tomofield::microscope
