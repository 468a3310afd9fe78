#include "kernels/convolution.h"

#include "base/check.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/convolution.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kTaps = 27;

// Computes a group of channels of a vector of voxels. `in` is the first voxel's neighbour at tap 0,
// in the first input channel. Each vector of the input is read once and meets the weights of all
// outputs: one load and kOutputsTogether broadcasts for as many multiplications.
template <class D>
HWY_INLINE void convolve_vector(D d, const ChannelShape& shape, int num_in, const float* weights,
                                const float* in, hn::Vec<D>* sums) {
  for (int o = 0; o < kOutputsTogether; ++o) sums[o] = hn::Zero(d);
  for (int i = 0; i < num_in; ++i, in += shape.stride_channel()) {
    for (int row = 0; row < 9; ++row) {
      const float* const first = in + row / 3 * shape.stride_z() + row % 3 * shape.stride_y();
      for (int x = 0; x < 3; ++x, weights += kOutputsTogether) {
        const auto values = hn::LoadU(d, first + x);
        for (int o = 0; o < kOutputsTogether; ++o)
          sums[o] = hn::MulAdd(values, hn::Set(d, weights[o]), sums[o]);
      }
    }
  }
}

void convolve_row(const ChannelShape& shape, const Convolution& c, const float* weights,
                  const float* in, float* out) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto slope = hn::Set(d, c.slope);
  for (int x = 0; x < shape.nx; x += lanes) {
    hn::Vec<decltype(d)> sums[kOutputsTogether];
    convolve_vector(d, shape, c.num_in, weights, in + x, sums);
    const auto count = static_cast<std::size_t>(shape.nx - x);
    for (int o = 0; o < kOutputsTogether; ++o) {
      const auto value = hn::Max(sums[o], hn::Mul(slope, sums[o]));
      hn::BlendedStore(value, hn::FirstN(d, count), d, out + o * shape.stride_channel() + x);
    }
  }
}

void convolve_planes(const ChannelShape& shape, const Convolution& c, base::Range planes,
                     const float* in, float* out) {
  for (int first = 0; first < c.num_out; first += kOutputsTogether) {
    const float* const weights = c.weights + static_cast<std::ptrdiff_t>(first) * c.num_in * kTaps;
    for (int z = planes.begin; z < planes.end; ++z) {
      for (int y = 0; y < shape.ny; ++y)
        convolve_row(shape, c, weights, in + shape.at(-1, y - 1, z - 1),
                     out + first * shape.stride_channel() + shape.at(0, y, z));
    }
  }
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(convolve_planes);

void convolve(const ChannelShape& shape, const Convolution& convolution, base::Range planes,
              const float* in, float* out) {
  TOMOFIELD_CHECK(convolution.num_out % kOutputsTogether == 0, "whole groups of outputs");
  HWY_DYNAMIC_DISPATCH(convolve_planes)(shape, convolution, planes, in, out);
}

}  // namespace tomofield::kernels
#endif
