#include "fourier/real_transform.h"

#include <fftw3.h>

#include <memory>

#include "base/check.h"
#include "fourier/fftw_plan.h"

namespace tomofield::fourier {

struct RealTransform::Plans {
  FftwPlan forward, inverse;
};

std::shared_ptr<const RealTransform::Plans> RealTransform::make_plans() const {
  const int width = static_cast<int>(width_), height = static_cast<int>(height_);
  Image image(image_size());
  Spectrum spectrum(spectrum_size());
  auto* complex = reinterpret_cast<fftwf_complex*>(spectrum.data());
  // The constructor of the plans is called in place, because they cannot be moved.
  return std::shared_ptr<const Plans>(
      new Plans{FftwPlan([&] {
                  return fftwf_plan_dft_r2c_2d(height, width, image.data(), complex,
                                               FFTW_ESTIMATE | FFTW_PRESERVE_INPUT);
                }),
                FftwPlan([&] {
                  return fftwf_plan_dft_c2r_2d(height, width, complex, image.data(), FFTW_ESTIMATE);
                })});
}

void RealTransform::forward(Image& image, Spectrum& spectrum) const {
  TOMOFIELD_CHECK(image.size() == image_size() && spectrum.size() == spectrum_size(),
                  "size of the image");
  fftwf_execute_dft_r2c(plans_->forward.get(), image.data(),
                        reinterpret_cast<fftwf_complex*>(spectrum.data()));
}

void RealTransform::inverse(Spectrum& spectrum, Image& image) const {
  TOMOFIELD_CHECK(image.size() == image_size() && spectrum.size() == spectrum_size(),
                  "size of the image");
  fftwf_execute_dft_c2r(plans_->inverse.get(), reinterpret_cast<fftwf_complex*>(spectrum.data()),
                        image.data());
}

}  // namespace tomofield::fourier
