#include "prior/network.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "base/threads/parallel.h"
#include "random_arrays.h"

namespace tomofield::prior {
namespace {

using testing::random_floats;

// One channel after another, [x, z, y] each, in double precision.
struct Channels {
  int nx = 0, nz = 0, ny = 0;
  std::vector<std::vector<double>> values;

  Channels(int x, int z, int y, std::size_t count)
      : nx(x), nz(z), ny(y), values(count, std::vector<double>(std::size_t(x * z * y))) {}
  double& at(std::size_t c, int x, int z, int y) {
    return values[c][std::size_t((x * nz + z) * ny + y)];
  }
  double in(std::size_t c, int x, int z, int y) const {
    const bool inside = x >= 0 && x < nx && z >= 0 && z < nz && y >= 0 && y < ny;
    return inside ? values[c][std::size_t((x * nz + z) * ny + y)] : 0.0;
  }
};

// The network as its header describes it, by another route than the kernels.
class Reference {
 public:
  explicit Reference(const std::vector<float>& weights) : next_(weights.data()) {}

  Channels apply(const Channels& in) {
    const Channels fine = convolved(convolved(in, 8), 8);
    const Channels half = convolved(convolved(halved(fine), 16), 16);
    const Channels quarter = convolved(convolved(halved(half), 32), 32);
    const Channels up = convolved(convolved(joined(half, quarter), 16), 16);
    Channels last = convolved(convolved(joined(fine, up), 8), 8);
    Channels out(in.nx, in.nz, in.ny, 1);
    out.values[0] = in.values[0];
    for (std::size_t c = 0; c < 8; ++c, ++next_)
      for (std::size_t i = 0; i < out.values[0].size(); ++i)
        out.values[0][i] += static_cast<double>(*next_) * last.values[c][i];
    return out;
  }

 private:
  Channels convolved(const Channels& in, std::size_t num_out) {
    Channels out(in.nx, in.nz, in.ny, num_out);
    for (std::size_t o = 0; o < num_out; ++o) {
      for (std::size_t i = 0; i < in.values.size(); ++i, next_ += 27) {
        for (int v = 0; v < in.nx * in.nz * in.ny; ++v) {
          const int x = v / (in.nz * in.ny), z = v / in.ny % in.nz, y = v % in.ny;
          for (int t = 0; t < 27; ++t)
            out.at(o, x, z, y) += static_cast<double>(next_[t]) *
                                  in.in(i, x + t / 9 - 1, z + t / 3 % 3 - 1, y + t % 3 - 1);
        }
      }
      for (double& value : out.values[o]) value = std::max(value, 0.1 * value);
    }
    return out;
  }
  static Channels halved(const Channels& in) {
    Channels out(in.nx / 2, in.nz / 2, in.ny / 2, in.values.size());
    for (std::size_t c = 0; c < in.values.size(); ++c)
      for (int v = 0; v < in.nx * in.nz * in.ny; ++v) {
        const int x = v / (in.nz * in.ny), z = v / in.ny % in.nz, y = v % in.ny;
        out.at(c, x / 2, z / 2, y / 2) += in.in(c, x, z, y) / 8;
      }
    return out;
  }
  static Channels joined(const Channels& fine, const Channels& coarse) {
    Channels out = fine;
    for (std::size_t c = 0; c < coarse.values.size(); ++c) {
      out.values.emplace_back(fine.values[0].size());
      for (int v = 0; v < fine.nx * fine.nz * fine.ny; ++v) {
        const int x = v / (fine.nz * fine.ny), z = v / fine.ny % fine.nz, y = v % fine.ny;
        out.at(fine.values.size() + c, x, z, y) = coarse.in(c, x / 2, z / 2, y / 2);
      }
    }
    return out;
  }

  const float* next_;
};

TEST(PriorNetwork, IsTheOneOfItsDescription) {
  const BoxShape shape{8, 4, 20};
  const std::vector<float> weights = random_floats(Network::num_weights(), 1, -0.2, 0.2);
  std::vector<float> smooth = random_floats(shape.size(), 2);
  const std::vector<float> light = random_floats(shape.size(), 3);
  Channels in(shape.nx, shape.nz, shape.ny, 2);
  in.values = {testing::to_double(smooth), testing::to_double(light)};
  const Channels expected = Reference(weights).apply(in);
  Network(weights).apply(shape, smooth, light);
  double largest = 0;
  for (const double value : expected.values[0]) largest = std::max(largest, std::abs(value));
  for (std::size_t i = 0; i < smooth.size(); ++i)
    ASSERT_NEAR(smooth[i], expected.values[0][i], 1e-5 * largest) << i;
}

TEST(PriorNetwork, ScalesWithItsInputAndLeavesNothingAsItIs) {
  const BoxShape shape{12, 8, 16};
  const std::vector<float> some = random_floats(shape.size(), 4);
  std::vector<float> once = some, larger, nothing(shape.size());
  for (const float value : some) larger.push_back(8 * value);
  const std::vector<float> larger_light = larger;
  Network::trained().apply(shape, once, some);
  Network::trained().apply(shape, larger, larger_light);
  Network::trained().apply(shape, nothing, nothing);
  for (std::size_t i = 0; i < some.size(); ++i) {
    ASSERT_NEAR(larger[i], 8 * once[i], 1e-3) << i;
    ASSERT_EQ(nothing[i], 0.0f);
  }
}

}  // namespace
}  // namespace tomofield::prior
