#include "simulate/cryo/electron_counts.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "microscope/ctf.h"
#include "simulate/noise.h"

namespace tomofield::simulate {

double interaction_per_VA(double voltage_kV) {
  constexpr double kRestEnergy_keV = 510.99895;
  const double relativity = (kRestEnergy_keV + voltage_kV) / (2.0 * kRestEnergy_keV + voltage_kV);
  return 2.0 * std::numbers::pi * relativity /
         (microscope::electron_wavelength_A(voltage_kV) * 1e3 * voltage_kV);
}

double ElectronCounts::behind_ice(double tilt_deg) const {
  constexpr double kMeanFreePath_A = 3000.0;
  const double path_A = settings_.thickness_A / std::cos(tilt_deg * std::numbers::pi / 180.0);
  return settings_.dose_per_A2 * settings_.pixel_size_A * settings_.pixel_size_A *
         std::exp(-path_A / kMeanFreePath_A);
}

void ElectronCounts::expose(std::span<float> image, double tilt_deg, double gain) const {
  const double background = gain * behind_ice(tilt_deg);
  const double contrast = 2.0 * interaction_per_VA(settings_.voltage_kV) * settings_.pixel_size_A;
  for (float& value : image)
    value =
        static_cast<float>(background * std::max(0.0, 1.0 - contrast * static_cast<double>(value)));
}

FrameCounts draw_frames(std::span<const float> expected, std::int64_t width, std::uint64_t seed,
                        std::uint64_t first_stream) {
  const auto height = static_cast<std::uint64_t>(std::ssize(expected) / width);
  FrameCounts counts;
  counts.even.assign(expected.begin(), expected.end());
  for (float& value : counts.even) value *= 0.5f;
  counts.odd = counts.even;
  draw_counts(counts.even, width, seed, first_stream);
  draw_counts(counts.odd, width, seed, first_stream + height);
  for (std::size_t i = 0; i < expected.size(); ++i)
    counts.all.push_back(counts.even[i] + counts.odd[i]);
  return counts;
}

}  // namespace tomofield::simulate
