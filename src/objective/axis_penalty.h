#pragma once

#include <span>
#include <vector>

#include "tomofield/options.h"

namespace tomofield::objective {

/// Sets the isotropic Fourier prior on samples.
struct AxisPenaltyOptions {
  RingReference reference = RingReference::kMean;
  /// Eq. 8 weighs a frequency ζ by w(ζ) = 1 / (exp((cutoff − ζ) / width) + 1). The paper names
  /// neither the unit of ζ nor the width. Here ζ is in parts of the Nyquist frequency, and w is a
  /// soft step that leaves out the low frequencies, whose rings have few points.
  double cutoff = 0.2;
  double width = 0.05;
  double epsilon = 1e-3;  ///< smooths amplitudes at zero, in density units
};

/// Sizes of an array [slice, y, x] of samples, with the same spacing in x and in y.
struct SliceShape {
  int slices = 0, ny = 0, nx = 0;
  std::size_t plane() const { return static_cast<std::size_t>(ny) * nx; }
  std::size_t size() const { return plane() * slices; }
};

/// The spectra of a stack of slices [slice, v, u], with frequencies in the order 0, 1 … −1. Each
/// slice is multiplied by a Hann window and transformed by the unitary Fourier transform in x and
/// y. Without a window, the step from one edge to the opposite one would make a streak on the axes.
/// The window keeps the variance of white noise, so amplitudes do not depend on the shape.
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

/// Returns a Hann window of n samples with Σ w² = n.
std::vector<float> hann_window(int n);

/// Returns the reference amplitude of each ring of frequencies, averaged over the slices, and −1
/// for rings without points. Ring k has the frequencies whose radius, in cycles a sample times
/// max(nx, ny), rounds to k; the last ring is the Nyquist frequency. Frequencies with |u| < 2 or
/// |v| < 2 are left out, because the window spreads the axes and the mean to their neighbours.
std::vector<double> ring_references(const SliceSpectra& spectra, RingReference reference);

/// Computes the isotropic Fourier prior (eq. 7) of samples:
///
///   weight · mean over the frequencies of both axes of  w(ζ) max(0, A(ζ) − R(ζ)),
///
/// where A(ζ) is the mean amplitude over the slices and R the reference of its ring. Returns the
/// value and adds its gradient by the samples to `gradient`. The gradient takes R as a constant.
double axis_penalty(const SliceShape& shape, std::span<const float> samples,
                    const AxisPenaltyOptions& options, double weight, std::span<float> gradient);

}  // namespace tomofield::objective
