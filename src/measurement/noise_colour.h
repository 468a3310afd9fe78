#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fourier/real_transform.h"

namespace tomofield::measurement {

/// Weights the frequencies of a view's residual by the noise that the residual itself shows, so
/// that the data term becomes ½ w rᵀ W r: W is the inverse of the noise's power, which depends on
/// the length of a frequency alone.
///
/// The power of the residual is averaged over shells of frequencies, and smoothed over them. W is
/// its mean over all frequencies divided by it, between kLeast and kMost, times the factor that
/// makes rᵀ W r the sum of r² over the pixels: the noise units of the data term, and so the weights
/// of priors, stay what they are. White noise has W = 1. Thread-safe.
class NoiseColour {
 public:
  static constexpr double kLeast = 0.25, kMost = 4.0;
  static constexpr std::int64_t kShells = 64;  ///< from frequency 0 to 1 / √2

  /// Makes ready for residuals of this size.
  NoiseColour(std::int64_t width, std::int64_t height);

  /// Replaces a residual [y, x] by W residual, and returns W of each shell. Pixels that do not
  /// count are 0 before, and have to be set to 0 afterwards.
  std::vector<double> weigh(std::span<float> residual) const;

  /// Returns the middle of a shell, in cycles a pixel.
  static double frequency_of(std::int64_t shell) {
    return (static_cast<double>(shell) + 0.5) / kShellsPerCycle;
  }

 private:
  static constexpr double kShellsPerCycle = static_cast<double>(kShells) / 0.70710678118654757;

  double copies_of(std::size_t i) const;
  std::vector<double> weights_of(const fourier::RealTransform::Spectrum& spectrum) const;

  std::int64_t width_, height_;
  fourier::RealTransform transform_;  // of the residual with zeros around it
  std::vector<float> places_;         // of each frequency of its spectrum, in shells
  std::vector<double> counts_;        // of frequencies in each shell
};

}  // namespace tomofield::measurement
