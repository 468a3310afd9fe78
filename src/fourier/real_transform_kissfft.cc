#include "fourier/real_transform.h"

#include <algorithm>
#include <complex>
#include <memory>

#include "base/check.h"
#include "fourier/image_transform.h"

namespace tomofield::fourier {

// Holds the transform of complex images, which does twice the work.
struct RealTransform::Plans {
  ImageTransform complex;
};

std::shared_ptr<const RealTransform::Plans> RealTransform::make_plans() const {
  return std::make_shared<Plans>(Plans{ImageTransform(width_, height_)});
}

void RealTransform::forward(Image& image, Spectrum& spectrum) const {
  TOMOFIELD_CHECK(image.size() == image_size() && spectrum.size() == spectrum_size(),
                  "size of the image");
  ImageTransform::Image whole(image.begin(), image.end());
  plans_->complex.forward(whole);
  for (std::int64_t y = 0; y < height_; ++y)
    std::copy_n(whole.begin() + y * width_, half_width(), spectrum.begin() + y * half_width());
}

void RealTransform::inverse(Spectrum& spectrum, Image& image) const {
  TOMOFIELD_CHECK(image.size() == image_size() && spectrum.size() == spectrum_size(),
                  "size of the image");
  ImageTransform::Image whole(image_size());
  for (std::int64_t y = 0; y < height_; ++y)
    for (std::int64_t x = 0; x < width_; ++x) {
      const bool is_kept = x < half_width();
      const std::int64_t kept_y = is_kept ? y : (height_ - y) % height_;
      const auto value =
          spectrum[static_cast<std::size_t>(kept_y * half_width() + (is_kept ? x : width_ - x))];
      whole[static_cast<std::size_t>(y * width_ + x)] = is_kept ? value : std::conj(value);
    }
  plans_->complex.inverse(whole);
  const auto factor = static_cast<float>(width_ * height_);
  for (std::size_t i = 0; i < whole.size(); ++i) image[i] = factor * whole[i].real();
}

}  // namespace tomofield::fourier
