#pragma once

#include <complex>
#include <cstdint>
#include <memory>

#include "base/aligned_buffer.h"

namespace tomofield::fourier {

/// Transforms real images [y, x] of one size by Fourier and back. It keeps the half of the spectrum
/// that tells the other half: [ky, kx] with kx from 0 to width / 2. Thread-safe. Copies share the
/// plans.
class RealTransform {
 public:
  using Image = base::AlignedBuffer<float>;                   ///< of image_size()
  using Spectrum = base::AlignedBuffer<std::complex<float>>;  ///< of spectrum_size()

  /// `width` is even.
  RealTransform(std::int64_t width, std::int64_t height);

  /// Computes Σ image exp(−2πi (kx x / width + ky y / height)).
  void forward(Image& image, Spectrum& spectrum) const;
  /// Undoes forward(), but leaves out its factor 1 / (width height). The contents of `spectrum` are
  /// unspecified afterwards.
  void inverse(Spectrum& spectrum, Image& image) const;

  std::int64_t width() const { return width_; }
  std::int64_t height() const { return height_; }
  std::int64_t half_width() const { return width_ / 2 + 1; }
  std::size_t image_size() const { return static_cast<std::size_t>(width_ * height_); }
  std::size_t spectrum_size() const { return static_cast<std::size_t>(half_width() * height_); }

 private:
  struct Plans;  // of the library that computes the transforms
  std::shared_ptr<const Plans> make_plans() const;

  std::int64_t width_, height_;
  std::shared_ptr<const Plans> plans_;
};

}  // namespace tomofield::fourier
