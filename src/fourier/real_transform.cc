#include "fourier/real_transform.h"

#include "base/check.h"

namespace tomofield::fourier {

RealTransform::RealTransform(std::int64_t width, std::int64_t height)
    : width_(width), height_(height), plans_(make_plans()) {
  TOMOFIELD_CHECK(width % 2 == 0, "width of the image");
}

}  // namespace tomofield::fourier
