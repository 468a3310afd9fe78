#include "baseline/classical/slab_gradient.h"

#include <algorithm>
#include <cstddef>

#include "kernels/lanes.h"

namespace tomofield::baseline {

using kernels::kLanes;

void gradient_of_row(const projection::SampleSegment& segment, int k, int num_rows,
                     const GradientFactors& factors, const float* samples, const float* above,
                     float* out_x, float* out_y, float* out_z) {
  float factor_y[kLanes];
  for (int l = 0; l < kLanes; ++l) {
    const bool has_next = l + 1 < num_rows || (l + 1 == kLanes && above != nullptr);
    factor_y[l] = has_next ? factors.y : 0.0f;
  }
  const std::ptrdiff_t row = segment.origin + k * segment.stride_z();
  const std::ptrdiff_t up = k + 1 < segment.nz ? segment.stride_z() : 0;
  for (int i = 0; i < segment.nx; ++i) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(i) * kLanes;
    const float* f = samples + row + at;
    const float* right = f + (i + 1 < segment.nx ? kLanes : 0);
    float next[kLanes];
    std::copy(f + 1, f + kLanes, next);
    next[kLanes - 1] = above != nullptr ? above[row + at] : 0.0f;
    for (int l = 0; l < kLanes; ++l) {
      out_x[at + l] = factors.x * (right[l] - f[l]);
      out_y[at + l] = factor_y[l] * (next[l] - f[l]);
      out_z[at + l] = factors.z * (f[up + l] - f[l]);
    }
  }
}

void add_gradient_adjoint_of_row(const projection::SampleSegment& segment, int k,
                                 const GradientFactors& factors, const float* p_x, const float* p_y,
                                 const float* p_z, const float* p_y_below, float* samples) {
  const std::ptrdiff_t stride = segment.stride_z();
  const std::ptrdiff_t row = segment.origin + k * stride;
  const std::ptrdiff_t end = row + static_cast<std::ptrdiff_t>(segment.nx) * kLanes;
  for (std::ptrdiff_t at = row; at < end; at += kLanes) {
    float before[kLanes];
    before[0] = p_y_below != nullptr ? p_y_below[at + kLanes - 1] : 0.0f;
    std::copy(p_y + at, p_y + at + kLanes - 1, before + 1);
    for (int l = 0; l < kLanes; ++l) {
      const std::ptrdiff_t i = at + l;
      samples[i] += factors.x * (p_x[i - kLanes] - p_x[i]) + factors.y * (before[l] - p_y[i]) +
                    factors.z * (p_z[i - stride] - p_z[i]);
    }
  }
}

}  // namespace tomofield::baseline
