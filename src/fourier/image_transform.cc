#include "fourier/image_transform.h"

#include <kiss_fft.h>

#include <cstdlib>

#include "base/check.h"

namespace tomofield::fourier {
namespace {

void free_plan(kiss_fft_state* plan) { std::free(plan); }

kiss_fft_state* make_plan(std::int64_t length, bool inverse) {
  kiss_fft_state* plan = kiss_fft_alloc(static_cast<int>(length), inverse, nullptr, nullptr);
  TOMOFIELD_CHECK(plan != nullptr, "plan of the transform");
  return plan;
}

}  // namespace

ImageTransform::ImageTransform(std::int64_t width, std::int64_t height)
    : width_(width),
      height_(height),
      forward_rows_(make_plan(width, false), &free_plan),
      forward_columns_(make_plan(height, false), &free_plan),
      inverse_rows_(make_plan(width, true), &free_plan),
      inverse_columns_(make_plan(height, true), &free_plan) {}

void ImageTransform::forward(Image& image) const {
  transform(image, forward_rows_, forward_columns_);
}

void ImageTransform::inverse(Image& image) const {
  transform(image, inverse_rows_, inverse_columns_);
  const float factor = 1.0f / static_cast<float>(width_ * height_);
  for (std::complex<float>& value : image) value *= factor;
}

void ImageTransform::transform(Image& image, const Plan& rows, const Plan& columns) const {
  TOMOFIELD_CHECK(std::ssize(image) == width_ * height_, "size of the image");
  std::vector<kiss_fft_cpx> values(image.size()), line(static_cast<std::size_t>(height_));
  const auto at = [&](std::int64_t x, std::int64_t y) {
    return static_cast<std::size_t>(y * width_ + x);
  };
  for (std::size_t i = 0; i < image.size(); ++i) values[i] = {image[i].real(), image[i].imag()};
  std::vector<kiss_fft_cpx> row(static_cast<std::size_t>(width_));
  for (std::int64_t y = 0; y < height_; ++y) {
    kiss_fft(rows.get(), values.data() + y * width_, row.data());
    std::copy(row.begin(), row.end(), values.begin() + y * width_);
  }
  for (std::int64_t x = 0; x < width_; ++x) {
    kiss_fft_stride(columns.get(), values.data() + x, line.data(), static_cast<int>(width_));
    for (std::int64_t y = 0; y < height_; ++y) {
      const kiss_fft_cpx& value = line[static_cast<std::size_t>(y)];
      image[at(x, y)] = {value.r, value.i};
    }
  }
}

std::int64_t fast_even_size(std::int64_t size) {
  return 2 * kiss_fft_next_fast_size(static_cast<int>((size + 1) / 2));
}

}  // namespace tomofield::fourier
