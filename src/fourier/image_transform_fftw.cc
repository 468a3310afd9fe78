#include <fftw3.h>

#include <memory>

#include "fourier/fftw_plan.h"
#include "fourier/image_transform.h"

namespace tomofield::fourier {

struct ImageTransform::Plan : FftwPlan {
  using FftwPlan::FftwPlan;
};

std::shared_ptr<const ImageTransform::Plan> ImageTransform::make_plan(bool is_inverse) const {
  Image image(static_cast<std::size_t>(width_ * height_));
  auto* values = reinterpret_cast<fftwf_complex*>(image.data());
  return std::make_shared<Plan>([&] {
    return fftwf_plan_dft_2d(static_cast<int>(height_), static_cast<int>(width_), values, values,
                             is_inverse ? FFTW_BACKWARD : FFTW_FORWARD,
                             FFTW_ESTIMATE | FFTW_UNALIGNED);
  });
}

void ImageTransform::transform(Image& image, const Plan& plan) const {
  auto* values = reinterpret_cast<fftwf_complex*>(image.data());
  fftwf_execute_dft(plan.get(), values, values);
}

}  // namespace tomofield::fourier
