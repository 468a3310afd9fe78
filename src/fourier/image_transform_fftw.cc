#include <fftw3.h>

#include <memory>
#include <mutex>

#include "base/check.h"
#include "fourier/image_transform.h"

namespace tomofield::fourier {

struct ImageTransform::Plan {
  fftwf_plan plan;

  // FFTW makes and frees one plan at a time.
  static std::mutex& one_at_a_time() {
    static std::mutex mutex;
    return mutex;
  }

  explicit Plan(fftwf_plan made) : plan(made) {}
  Plan(const Plan&) = delete;
  Plan& operator=(const Plan&) = delete;
  ~Plan() {
    const std::lock_guard lock(one_at_a_time());
    fftwf_destroy_plan(plan);
  }
};

// A plan that was not measured is the same in every run, so the results have the same bits.
std::shared_ptr<const ImageTransform::Plan> ImageTransform::make_plan(bool is_inverse) const {
  Image image(static_cast<std::size_t>(width_ * height_));
  auto* values = reinterpret_cast<fftwf_complex*>(image.data());
  const std::lock_guard lock(Plan::one_at_a_time());
  fftwf_plan plan =
      fftwf_plan_dft_2d(static_cast<int>(height_), static_cast<int>(width_), values, values,
                        is_inverse ? FFTW_BACKWARD : FFTW_FORWARD, FFTW_ESTIMATE | FFTW_UNALIGNED);
  TOMOFIELD_CHECK(plan != nullptr, "plan of the transform");
  return std::make_shared<Plan>(plan);
}

void ImageTransform::transform(Image& image, const Plan& plan) const {
  auto* values = reinterpret_cast<fftwf_complex*>(image.data());
  fftwf_execute_dft(plan.plan, values, values);
}

}  // namespace tomofield::fourier
