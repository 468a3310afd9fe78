#include "fourier/image_transform.h"

#include <kiss_fft.h>

#include <cstdlib>
#include <memory>
#include <vector>

#include "base/check.h"

namespace tomofield::fourier {
namespace {

void free_plan(kiss_fft_state* plan) { std::free(plan); }

kiss_fft_state* make_line_plan(std::int64_t length, bool inverse) {
  kiss_fft_state* plan = kiss_fft_alloc(static_cast<int>(length), inverse, nullptr, nullptr);
  TOMOFIELD_CHECK(plan != nullptr, "plan of the transform");
  return plan;
}

}  // namespace

// Holds the plans of the rows and of the columns.
struct ImageTransform::Plan {
  using Line = std::unique_ptr<kiss_fft_state, void (*)(kiss_fft_state*)>;
  Line rows, columns;
};

std::shared_ptr<const ImageTransform::Plan> ImageTransform::make_plan(bool is_inverse) const {
  return std::make_shared<Plan>(Plan{{make_line_plan(width_, is_inverse), &free_plan},
                                     {make_line_plan(height_, is_inverse), &free_plan}});
}

void ImageTransform::transform(Image& image, const Plan& plan) const {
  std::vector<kiss_fft_cpx> values(image.size()), line(static_cast<std::size_t>(height_));
  const auto at = [&](std::int64_t x, std::int64_t y) {
    return static_cast<std::size_t>(y * width_ + x);
  };
  for (std::size_t i = 0; i < image.size(); ++i) values[i] = {image[i].real(), image[i].imag()};
  std::vector<kiss_fft_cpx> row(static_cast<std::size_t>(width_));
  for (std::int64_t y = 0; y < height_; ++y) {
    kiss_fft(plan.rows.get(), values.data() + y * width_, row.data());
    std::copy(row.begin(), row.end(), values.begin() + y * width_);
  }
  for (std::int64_t x = 0; x < width_; ++x) {
    kiss_fft_stride(plan.columns.get(), values.data() + x, line.data(), static_cast<int>(width_));
    for (std::int64_t y = 0; y < height_; ++y) {
      const kiss_fft_cpx& value = line[static_cast<std::size_t>(y)];
      image[at(x, y)] = {value.r, value.i};
    }
  }
}

}  // namespace tomofield::fourier
