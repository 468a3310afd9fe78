#include "kernels/convolution.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

#include "kernels/reference/reference_kernels.h"
#include "random_arrays.h"
#include "simd_targets.h"

namespace tomofield::kernels {
namespace {

using testing::for_each_simd_target;
using testing::random_floats;
using testing::to_double;

// Returns random channels with a border of zeros.
std::vector<float> random_channels(const ChannelShape& shape, int num_channels) {
  const auto size = static_cast<std::size_t>(num_channels * shape.stride_channel());
  std::vector<float> channels(size + 16);
  const std::vector<float> values = random_floats(size, 5);
  std::size_t next = 0;
  for (int c = 0; c < num_channels; ++c)
    for (int z = 0; z < shape.nz; ++z)
      for (int y = 0; y < shape.ny; ++y)
        for (int x = 0; x < shape.nx; ++x)
          channels[static_cast<std::size_t>(c * shape.stride_channel() + shape.at(x, y, z))] =
              values[next++];
  return channels;
}

std::vector<float> random_weights(int num_in, int num_out) {
  return random_floats(static_cast<std::size_t>(num_in * num_out * 27), 6);
}

TEST(Convolution, AgreesWithTheReference) {
  for_each_simd_target([] {
    for (const ChannelShape& shape : {ChannelShape{1, 1, 1}, ChannelShape{5, 3, 2},
                                      ChannelShape{16, 2, 3}, ChannelShape{37, 4, 3}}) {
      for (const auto& [num_in, num_out] : {std::pair{1, 8}, {3, 16}, {8, 8}}) {
        const std::vector<float> in = random_channels(shape, num_in);
        const std::vector<float> weights = random_weights(num_in, num_out);
        const Convolution convolution{num_in, num_out, 0.1f, weights.data()};
        std::vector<float> out(static_cast<std::size_t>(num_out * shape.stride_channel()) + 16);
        std::vector<double> expected(out.size());
        convolve(shape, convolution, {0, shape.nz}, in.data(), out.data());
        reference::convolve(shape, convolution, to_double(in).data(), expected.data());
        for (std::size_t i = 0; i < out.size(); ++i)
          ASSERT_NEAR(out[i], expected[i], 1e-5) << shape.nx << ", " << num_out << " at " << i;
      }
    }
  });
}

TEST(Convolution, LeavesTheBorderAndOtherPlanesAsTheyAre) {
  const ChannelShape shape{9, 3, 4};
  const std::vector<float> in = random_channels(shape, 1), weights = random_weights(1, 8);
  std::vector<float> out(static_cast<std::size_t>(8 * shape.stride_channel()) + 16, 7.0f);
  convolve(shape, {1, 8, 1.0f, weights.data()}, {1, 2}, in.data(), out.data());
  std::size_t changed = 0;
  for (const float value : out) changed += value != 7.0f;
  EXPECT_EQ(changed, std::size_t{8 * 9 * 3});
  EXPECT_NE(out[static_cast<std::size_t>(shape.at(8, 2, 1))], 7.0f);
}

}  // namespace
}  // namespace tomofield::kernels
