#include "objective/noise_scale.h"

#include <algorithm>
#include <cmath>

namespace tomofield::objective {

double typical_noise(std::span<const double> sigma_of_view) {
  double precision = 0.0;
  for (const double sigma : sigma_of_view) precision += 1.0 / (sigma * sigma);
  return std::sqrt(static_cast<double>(sigma_of_view.size()) / precision);
}

double concavity(double in_voxel_noise, std::span<const double> sigma_of_view) {
  constexpr double kMinConcavity = 0.02;
  const double noise =
      typical_noise(sigma_of_view) / std::sqrt(static_cast<double>(sigma_of_view.size()));
  return std::max(in_voxel_noise * noise, kMinConcavity);
}

double gain_of_little_noise(double noise, double contrast) {
  constexpr double kLittle = 0.15;
  return std::max(1.0, kLittle * contrast / noise);
}

}  // namespace tomofield::objective
