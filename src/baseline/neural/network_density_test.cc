#include "baseline/neural/network_density.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "baseline/neural/encodings.h"
#include "central_difference.h"
#include "kernels/lanes.h"
#include "random_arrays.h"

namespace tomofield::baseline {
namespace {

constexpr std::int64_t kNumRows = 21;

projection::SampleGrid small_grid() {
  projection::SampleSegment middle, margin;
  middle.nx = 5;
  middle.nz = 4;
  margin.x0 = -4;
  margin.nx = 2;
  margin.nz = 2;
  margin.hx = margin.hz = 2;
  return projection::SampleGrid({middle, margin});
}

const projection::SampleGrid kGrid = small_grid();

std::unique_ptr<PointEncoding> hash_grid() {
  // The finest level has more vertices than its table, so it is hashed.
  return std::make_unique<HashGrid>(
      box_of(kGrid, kNumRows),
      HashGridOptions{.levels = 3, .coarsest = 4, .finest = 1, .table_bits = 8});
}

std::unique_ptr<PointEncoding> plane_waves() { return std::make_unique<FourierEncoding>(20, 6, 2); }

NetworkDensity density_of(std::unique_ptr<PointEncoding> encoding, bool non_negative) {
  NetworkDensity density(kGrid, kNumRows, std::move(encoding),
                         {.hidden_layers = 2,
                          .width = 6,
                          .non_negative = non_negative,
                          .mean_density = 0.3,
                          .seed = 4});
  // Features of vertices start near zero, where nothing would depend on the position.
  base::Random random(9);
  for (float& p : density.parameters()) p += static_cast<float>(random.uniform(-0.2, 0.2));
  return density;
}

std::vector<float> random_weights() { return testing::random_floats(kGrid.size(), 12); }

double weighted_sum(NetworkDensity& density, const RowSet& rows,
                    const std::vector<float>& weights) {
  std::vector<float> samples(kGrid.size(), 0.0f);
  density.decode(rows, samples.data());
  return testing::dot(samples, weights);
}

void expect_gradient(NetworkDensity density, const RowSet& rows) {
  const std::vector<float> weights = random_weights();
  std::vector<float> gradient(density.num_parameters());
  density.accumulate(rows, weights.data(), gradient);
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < gradient.size(); i += 5) {
    const double expected = testing::central_difference(
        density.parameters()[i], 5e-4f, [&] { return weighted_sum(density, rows, weights); });
    difference += std::pow(expected - static_cast<double>(gradient[i]), 2);
    size += expected * expected;
  }
  EXPECT_GT(size, 1e-3);
  EXPECT_LT(difference, 5e-3 * size);  // rectifiers have corners
}

TEST(NetworkDensity, GradientIsThatOfFiniteDifferences) {
  base::set_thread_count(1);  // the work is too small for threads
  for (const RowSet& rows : {RowSet{0, 2, 4}, RowSet{1, 0, 2}}) {
    for (const bool non_negative : {true, false}) {
      expect_gradient(density_of(hash_grid(), non_negative), rows);
      expect_gradient(density_of(plane_waves(), non_negative), rows);
    }
  }
  base::set_thread_count(0);
}

TEST(NetworkDensity, HasTheSameBitsForAnyNumberOfThreads) {
  const auto gradient = [&](int threads) {
    base::set_thread_count(threads);
    NetworkDensity density = density_of(hash_grid(), true);
    std::vector<float> sum(density.num_parameters());
    density.accumulate({0, 1, 4}, random_weights().data(), sum);
    return sum;
  };
  EXPECT_EQ(gradient(1), gradient(3));
  base::set_thread_count(0);
}

TEST(NetworkDensity, WritesTheVoxelsOfItsRowsAlone) {
  NetworkDensity density = density_of(plane_waves(), true);
  std::vector<float> samples(kGrid.size(), -1.0f);
  const RowSet rows{1, 2, 1};
  density.decode(rows, samples.data());
  std::size_t written = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (samples[i] == -1.0f) continue;
    ++written;
    EXPECT_GE(samples[i], 0.0f);
    EXPECT_EQ(i % kernels::kLanes, 2u);
  }
  EXPECT_EQ(written, 5u * 4 + 2 * 2);
}

TEST(NetworkDensity, StartsAtTheMeanDensity) {
  for (const bool non_negative : {true, false}) {
    NetworkDensity density = density_of(plane_waves(), non_negative);
    for (float& p : density.parameters()) p = 0;
    std::vector<float> samples(kGrid.size(), -1.0f);
    density.decode({0, 0, 4}, samples.data());
    const float* first = samples.data() + kGrid.segments().front().origin;
    EXPECT_NEAR(*first, 0.3, 1e-6) << non_negative;
  }
}

TEST(RowSet, AllAreEveryRowOnce) {
  for (const std::int64_t num_rows : {3, 16, 21, 48}) {
    std::vector<int> count(static_cast<std::size_t>(num_rows));
    for (const RowSet& rows : RowSet::all(num_rows)) {
      EXPECT_GT(rows.num_rows, 0);
      for (std::size_t lane = 0; lane < 16; ++lane)
        if ((rows.lanes() >> lane & 1) != 0)
          ++count.at(static_cast<std::size_t>(rows.slab) * 16 + lane);
    }
    EXPECT_EQ(count, std::vector<int>(count.size(), 1)) << num_rows;
  }
}

TEST(NetworkDensity, SizeIsKnownBeforeAnythingIsAllocated) {
  const NetworkDensity::Shape shape{.hidden_layers = 2, .width = 6};
  EXPECT_EQ(NetworkDensity::size(kGrid, kNumRows, *hash_grid(), shape, 1).num_parameters,
            density_of(hash_grid(), true).num_parameters());
  projection::SampleSegment huge;
  huge.nx = huge.nz = 1 << 20;
  const HashGrid encoding({1e6f, 16.0f, 1e6f}, {.levels = 32, .finest = 1.0, .table_bits = 28});
  const projection::SampleGrid grid({huge});
  const MethodSize size = NetworkDensity::size(grid, 16, encoding, shape, 1);
  // There are four rows of points, of 12 bytes and 64 features each.
  const double points = 4 * std::exp2(40.0);
  EXPECT_GE(static_cast<double>(size.bytes), (12 + 4 * 64) * points);
  EXPECT_LT(static_cast<double>(size.bytes), 1.01 * (12 + 4 * 64) * points);
}

}  // namespace
}  // namespace tomofield::baseline
