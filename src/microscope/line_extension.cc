#include "microscope/line_extension.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tomofield::microscope {

LineExtension::LineExtension(std::int64_t length, std::int64_t extended_length) : length_(length) {
  for (std::int64_t i = 0; i < length; ++i) values_.push_back({{i, i}, {1.0f, 0.0f}});
  const std::int64_t gap = extended_length - length;
  for (std::int64_t i = 0; i < gap; ++i) {
    const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(gap);
    const double turned = 0.5 - 0.5 * std::cos(std::numbers::pi * share);
    values_.push_back(
        {{std::max<std::int64_t>(length - 1 - i, 0), std::min(gap - 1 - i, length - 1)},
         {static_cast<float>(1.0 - turned), static_cast<float>(turned)}});
  }
}

}  // namespace tomofield::microscope
