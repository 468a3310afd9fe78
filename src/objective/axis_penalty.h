#pragma once

#include <span>
#include <vector>

#include "tomofield/options.h"

namespace tomofield::objective {

struct AxisPenaltyOptions {
  RingReference reference = RingReference::kMean;
  /// Eq. 8, w(ζ) = 1 / (exp((cutoff − ζ) / width) + 1), with ζ in parts of the
  /// Nyquist frequency. The paper names no unit and no width; this is a soft
  /// step, which leaves the low frequencies, where few points make a ring, alone.
  double cutoff = 0.2;
  double width = 0.05;
  double epsilon = 1e-3;  ///< density units; smooths amplitudes at zero
};

/// Samples of `slices` sections, [slice, y, x], evenly spaced in x and y alike.
struct SliceShape {
  int slices = 0, ny = 0, nx = 0;
  std::size_t plane() const { return static_cast<std::size_t>(ny) * nx; }
  std::size_t size() const { return plane() * slices; }
};

/// Spectra of a stack of slices: a Hann window (without which the step from one
/// edge to the opposite one would itself be a streak on the axes), then the
/// unitary transform in (x, y). The window is scaled to keep the variance of
/// white noise, so amplitudes are those of the samples for any shape.
/// Frequencies are [slice, v, u] in the usual order: 0, 1 … −1.
class SliceSpectra {
 public:
  SliceSpectra(const SliceShape& shape, std::span<const float> samples);

  struct Complex {
    float re = 0.0f, im = 0.0f;
  };
  Complex at(int slice, int v, int u) const;
  const SliceShape& shape() const { return shape_; }

 private:
  SliceShape shape_;
  std::vector<Complex> values_;
};

/// Hann window of n samples between their centres, Σ w² = n.
std::vector<float> hann_window(int n);

/// Rings of a plane of frequencies: ring k holds those whose radius, in cycles
/// per sample times max(nx, ny), rounds to k, up to the Nyquist frequency.
/// Frequencies with |u| < 2 or |v| < 2 are left out: the axes themselves and
/// what the window spreads of them (and of the mean) to their neighbours.
/// Returns the reference of each ring, averaged over slices, and −1 for rings
/// without points.
std::vector<double> ring_references(const SliceSpectra& spectra, RingReference reference);

/// The isotropic Fourier prior (eq. 7) on samples: with A(ζ) the mean over slices
/// of the amplitude at a frequency on either axis and R its ring's reference,
///
///   mean over both axes of  w(ζ) max(0, A(ζ) − R(ζ)).
///
/// R is a constant to the gradient, which is added to `gradient` times `weight`.
/// Returns weight · the penalty, in density units.
double axis_penalty(const SliceShape& shape, std::span<const float> samples,
                    const AxisPenaltyOptions& options, double weight, std::span<float> gradient);

}  // namespace tomofield::objective
