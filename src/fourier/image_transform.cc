#include "fourier/image_transform.h"

#include "base/check.h"

namespace tomofield::fourier {
namespace {

// Says whether a size has no other prime factors than 2, 3 and 5.
bool is_fast(std::int64_t size) {
  for (const std::int64_t factor : {2, 3, 5})
    while (size % factor == 0) size /= factor;
  return size == 1;
}

}  // namespace

ImageTransform::ImageTransform(std::int64_t width, std::int64_t height)
    : width_(width), height_(height), forward_(make_plan(false)), inverse_(make_plan(true)) {}

void ImageTransform::forward(Image& image) const {
  TOMOFIELD_CHECK(std::ssize(image) == width_ * height_, "size of the image");
  transform(image, *forward_);
}

void ImageTransform::inverse(Image& image) const {
  TOMOFIELD_CHECK(std::ssize(image) == width_ * height_, "size of the image");
  transform(image, *inverse_);
  const float factor = 1.0f / static_cast<float>(width_ * height_);
  for (std::complex<float>& value : image) value *= factor;
}

std::int64_t fast_even_size(std::int64_t size) {
  std::int64_t half = (size + 1) / 2;
  while (!is_fast(half)) ++half;
  return 2 * half;
}

}  // namespace tomofield::fourier
