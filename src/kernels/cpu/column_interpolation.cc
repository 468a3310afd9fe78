#include "kernels/column_interpolation.h"

#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/column_interpolation.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {

// Both functions are bound by memory traffic. A column takes two FMAs a vector for 64 bytes of
// values, which are read and written, and two cache lines of vertices. The vertices lie a column
// apart and come from L2 at best.
void interpolate_columns(const Columns& columns, const float* vertices, float* values) {
  const Tag d;
  Vec lower[kVecs], upper[kVecs];
  for (int v = 0; v < kVecs; ++v) {
    upper[v] = hn::LoadU(d, columns.fraction + v * kVecLanes);
    lower[v] = hn::Sub(hn::Set(d, 1.0f), upper[v]);
  }
  for (std::ptrdiff_t n = 0; n < columns.count; ++n) {
    for (int v = 0; v < kVecs; ++v) {
      const float* const at = vertices + v * kVecLanes;
      const Vec sum = hn::MulAdd(lower[v], hn::LoadU(d, at), hn::LoadU(d, values + v * kVecLanes));
      hn::StoreU(hn::MulAdd(upper[v], hn::LoadU(d, at + 1), sum), d, values + v * kVecLanes);
    }
    vertices += columns.stride;
    values += kLanes;
  }
}

// Each vertex takes from its own lane and from the lane below, which is loaded from one float
// before. Lane 0 has no lane below; its weight there is 0.
void spread_columns(const Columns& columns, const float* values, float* vertices) {
  const Tag d;
  HWY_ALIGN float of_lane_below[kLanes];
  of_lane_below[0] = 0.0f;
  for (int l = 1; l < kLanes; ++l) of_lane_below[l] = columns.fraction[l - 1];
  const float last = columns.fraction[kLanes - 1];
  Vec lower[kVecs], below[kVecs];
  for (int v = 0; v < kVecs; ++v) {
    below[v] = hn::Load(d, of_lane_below + v * kVecLanes);
    lower[v] = hn::Sub(hn::Set(d, 1.0f), hn::LoadU(d, columns.fraction + v * kVecLanes));
  }
  // The first column is copied, because no memory lies before its values.
  HWY_ALIGN float first[kLanes + 1] = {};
  for (int l = 0; l < kLanes && columns.count > 0; ++l) first[l + 1] = values[l];
  const float* before = first;
  for (std::ptrdiff_t n = 0; n < columns.count; ++n) {
    for (int v = 0; v < kVecs; ++v) {
      float* const to = vertices + v * kVecLanes;
      const Vec sum = hn::MulAdd(below[v], hn::LoadU(d, before + v * kVecLanes), hn::LoadU(d, to));
      hn::StoreU(hn::MulAdd(lower[v], hn::LoadU(d, values + v * kVecLanes), sum), d, to);
    }
    vertices[kLanes] += last * values[kLanes - 1];
    vertices += columns.stride;
    values += kLanes;
    before = values - 1;
  }
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(interpolate_columns);
HWY_EXPORT(spread_columns);

void interpolate_columns(const Columns& columns, const float* vertices, float* values) {
  HWY_DYNAMIC_DISPATCH(interpolate_columns)(columns, vertices, values);
}
void spread_columns(const Columns& columns, const float* values, float* vertices) {
  HWY_DYNAMIC_DISPATCH(spread_columns)(columns, values, vertices);
}
}  // namespace tomofield::kernels
#endif
