#include "report/grey_scale.h"

#include <algorithm>
#include <cmath>

#include "base/percentile.h"

namespace tomofield::report {

GreyScale::GreyScale(std::vector<float> sample) {
  std::erase_if(sample, [](float value) { return !std::isfinite(value); });
  if (sample.empty()) return;
  black_ = base::percentile(sample, 0.5);
  const double white = base::percentile(sample, 99.5);
  if (white > black_) to_grey_ = 255.0 / (white - black_);
}

std::uint8_t GreyScale::grey(double value) const {
  const double grey = (value - black_) * to_grey_;
  return static_cast<std::uint8_t>(
      std::lround(std::isnan(grey) ? 0.0 : std::clamp(grey, 0.0, 255.0)));
}

std::int64_t picture_zoom(std::int64_t narrowest, std::int64_t widest) {
  constexpr std::int64_t kMinWidth_px = 512;
  constexpr std::int64_t kMaxWidth_px = 4096;
  return std::clamp<std::int64_t>((kMinWidth_px + narrowest - 1) / narrowest, 1,
                                  std::max<std::int64_t>(kMaxWidth_px / widest, 1));
}

}  // namespace tomofield::report
