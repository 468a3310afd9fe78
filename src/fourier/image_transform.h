#pragma once

#include <complex>
#include <cstdint>
#include <memory>
#include <vector>

namespace tomofield::fourier {

/// Transforms images [y, x] of one size by Fourier and back. Thread-safe. Copies share the plans.
class ImageTransform {
 public:
  using Image = std::vector<std::complex<float>>;

  ImageTransform(std::int64_t width, std::int64_t height);

  /// Replaces an image by Σ image exp(−2πi (kx x / width + ky y / height)), [ky, kx].
  void forward(Image& image) const;
  /// Undoes forward(), with its factor 1 / (width height).
  void inverse(Image& image) const;

  std::int64_t width() const { return width_; }
  std::int64_t height() const { return height_; }

 private:
  struct Plan;  // of the library that computes the transforms
  std::shared_ptr<const Plan> make_plan(bool is_inverse) const;
  void transform(Image& image, const Plan& plan) const;

  std::int64_t width_, height_;
  std::shared_ptr<const Plan> forward_, inverse_;
};

/// Returns the smallest even length of at least `size` whose transform is fast.
std::int64_t fast_even_size(std::int64_t size);

/// Returns the frequency of index `k` of a transform of length `size`, in cycles a pixel, −½ to ½.
inline double cycles_per_pixel(std::int64_t k, std::int64_t size) {
  const std::int64_t signed_k = 2 * k > size ? k - size : k;
  return static_cast<double>(signed_k) / static_cast<double>(size);
}

}  // namespace tomofield::fourier
