#include "projection/slab_sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "central_difference.h"
#include "kernels/lanes.h"
#include "random_arrays.h"

namespace tomofield::projection {
namespace {

using field::Region;
using kernels::kLanes;
using testing::random_floats;

constexpr double kThickness = 11.5;
constexpr std::int64_t kFirstRow = -8;
constexpr std::int64_t kRows = 90;  // the last slab has 10

// Returns a field with margin cells of 64 px on both sides of leaves of 64, 32 and 16 px, which
// have different numbers of vertices. With `pixel` 2, the smallest leaves have 32 px.
std::unique_ptr<field::Field> uneven_field(FieldKind kind, int pixel = 1) {
  using enum Region;
  const field::RootGrid roots{.x0 = -64, .y0 = kFirstRow, .cell_size = 64, .columns = 4, .rows = 2};
  field::Quadtree tree(roots, {kMargin, kInterest, kInterest, kMargin,  //
                               kMargin, kInterest, kInterest, kMargin});
  tree.split(1);
  if (pixel == 1) tree.split(2);
  tree.split(pixel == 1 ? 12 : 9);  // second cell of interest of the second band
  std::vector<field::LeafShape> shapes;
  for (int i = 0; i < tree.num_leaves(); ++i) {
    if (tree.leaf(i).region == kMargin) {
      shapes.push_back({.nx = 3, .ny = 4, .nz = 2, .rank_x = 1, .rank_y = 1, .rank_z = 1});
    } else {
      shapes.push_back(
          {.nx = 6 + i % 2, .ny = 5, .nz = 4 + i % 3, .rank_x = 2, .rank_y = 3, .rank_z = 1});
    }
  }
  auto field = make_field(kind, std::move(tree), kThickness, std::move(shapes));
  field->initialise(base::Random(3), 0.8);
  field->bias = 0.1f;
  field->activation = {3.0f};
  return field;
}

// Returns a grid that samples the columns of interest at one pixel and the margins at four.
SampleGrid uneven_grid(int pixel = 1) {
  const auto segment = [pixel](double x0, int nx, double h, int nz) {
    SampleSegment s;
    s.x0 = x0 / pixel;
    s.nx = nx / pixel;
    s.hx = h;
    s.nz = nz;
    s.hz = kThickness / pixel / nz;
    return s;
  };
  return SampleGrid({segment(0, 128, 1, 12), segment(-60, 15, 4, 3), segment(128, 16, 4, 3)});
}

// Calls visit(index into a slab buffer, x, y, z) for each sample.
template <typename Visit>
void for_each_sample(const SampleGrid& grid, int slab, Visit&& visit, int pixel = 1) {
  for (const SampleSegment& s : grid.segments()) {
    for (int k = 0; k < s.nz; ++k) {
      for (int i = 0; i < s.nx; ++i) {
        for (int l = 0; l < kLanes; ++l) {
          visit(static_cast<std::size_t>(s.origin + k * s.stride_z() + i * kLanes + l),
                pixel * (s.x0 + (i + 0.5) * s.hx),
                static_cast<double>(kFirstRow) + pixel * (slab * kLanes + l + 0.5),
                pixel * (k + 0.5) * s.hz);
        }
      }
    }
  }
}

class EachSampledField : public ::testing::TestWithParam<FieldKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, EachSampledField,
                         ::testing::Values(FieldKind::kVm, FieldKind::kGrid),
                         [](const auto& kind) { return base::name_of(kind.param); });

TEST_P(EachSampledField, DecodesTheDensityAtEverySample) {
  const auto field = uneven_field(GetParam());
  const SampleGrid grid = uneven_grid();
  const SlabSampler sampler(*field, grid, kFirstRow, kRows);
  ASSERT_EQ(sampler.num_slabs(), 6);
  for (int slab = 0; slab < sampler.num_slabs(); ++slab) {
    std::vector<float> samples(grid.size(), -7.0f);
    sampler.decode(slab, samples.data());
    std::size_t written = 0;
    double largest = 0.0;
    for_each_sample(grid, slab, [&](std::size_t at, double x, double y, double z) {
      largest =
          std::max(largest, std::abs(static_cast<double>(samples[at]) - field->density(x, y, z)));
      samples[at] = -7.0f;
      ++written;
    });
    EXPECT_LE(largest, 3e-6) << "slab " << slab;
    EXPECT_EQ(samples, std::vector<float>(grid.size(), -7.0f)) << "padding was written";
    EXPECT_GT(written, 0u);
  }
}

TEST_P(EachSampledField, DecodesCoarsePixelsToo) {
  constexpr int kPixel = 2;
  const auto field = uneven_field(GetParam(), kPixel);
  const SampleGrid grid = uneven_grid(kPixel);
  const SlabSampler sampler(*field, grid, kFirstRow, kRows / kPixel, kPixel);
  ASSERT_EQ(sampler.num_slabs(), 3);
  EXPECT_EQ(sampler.rows_in_slab(2), 13);
  ASSERT_EQ(sampler.num_bands(), 2);
  EXPECT_EQ(sampler.band(0).end, 2);
  std::vector<float> row(sampler.row_size());
  for (int slab = 0; slab < sampler.num_slabs(); ++slab) {
    std::vector<float> samples(grid.size());
    sampler.decode(slab, samples.data());
    double largest = 0.0;
    for_each_sample(
        grid, slab,
        [&](std::size_t at, double x, double y, double z) {
          largest = std::max(largest,
                             std::abs(static_cast<double>(samples[at]) - field->density(x, y, z)));
        },
        kPixel);
    EXPECT_LE(largest, 3e-6) << "slab " << slab;
    sampler.decode_row(slab * kLanes + 3, row.data());
    const SampleSegment& first = grid.segments()[0];
    EXPECT_NEAR(
        row[static_cast<std::size_t>(5 * first.nz + 2)],
        samples[static_cast<std::size_t>(first.origin + 2 * first.stride_z() + 5 * kLanes + 3)],
        2e-6);
  }
}

TEST_P(EachSampledField, AdjointIsTheDerivative) {
  const auto field = uneven_field(GetParam());
  const SampleGrid grid = uneven_grid();
  const SlabSampler sampler(*field, grid, kFirstRow, kRows);
  constexpr int kSlab = 1;
  auto weights = random_floats(grid.size(), 4);
  std::vector<float> samples(grid.size());
  sampler.decode(kSlab, samples.data());
  const auto before = random_floats(field->num_parameters(), 6);
  std::vector<float> gradient = before;
  const double grad_bias =
      sampler.decode_adjoint(kSlab, samples.data(), weights.data(), gradient.data());

  const auto objective = [&] {
    double sum = 0.0;
    for_each_sample(grid, kSlab, [&](std::size_t at, double x, double y, double z) {
      sum += static_cast<double>(weights[at]) * field->density(x, y, z);
    });
    return sum;
  };
  const auto derivative = [&](float& p) {
    return testing::central_difference(p, 1e-3f, objective);
  };
  EXPECT_NEAR(grad_bias, derivative(field->bias), 3e-3);
  base::Random random(12);
  for (int n = 0; n < 40; ++n) {
    const int leaf =
        static_cast<int>(random.below(static_cast<std::uint64_t>(field->tree().num_leaves())));
    const std::size_t at =
        field->offset(leaf) + random.below(field->offset(leaf + 1) - field->offset(leaf));
    EXPECT_NEAR(static_cast<double>(gradient[at]) - static_cast<double>(before[at]),
                derivative(field->parameters()[at]), 6e-4)
        << "leaf " << leaf << " parameter " << at;
  }
  // Leaves that the slab does not meet must stay as they are.
  for (int leaf = 0; leaf < field->tree().num_leaves(); ++leaf) {
    if (field->tree().band_of_leaf(leaf) == 0) continue;
    for (std::size_t at = field->offset(leaf); at < field->offset(leaf + 1); ++at)
      ASSERT_EQ(gradient[at], before[at]);
  }
}

TEST_P(EachSampledField, DecodedRowIsALaneOfTheSlab) {
  const auto field = uneven_field(GetParam());
  const SampleGrid grid = uneven_grid();
  const SlabSampler sampler(*field, grid, kFirstRow, kRows);
  for (const std::int64_t row : {0L, 15L, 16L, 63L, 64L, 89L}) {
    const int slab = static_cast<int>(row / kLanes);
    const std::int64_t lane = row % kLanes;
    std::vector<float> samples(grid.size()), densities(sampler.row_size());
    sampler.decode(slab, samples.data());
    sampler.decode_row(row, densities.data());
    for (std::size_t s = 0; s < grid.segments().size(); ++s) {
      const SampleSegment& segment = grid.segments()[s];
      for (int i = 0; i < segment.nx; ++i) {
        for (int k = 0; k < segment.nz; ++k) {
          const auto at =
              static_cast<std::size_t>(segment.origin + k * segment.stride_z() + i * kLanes + lane);
          ASSERT_NEAR(
              densities[sampler.row_origin(s) + static_cast<std::size_t>(i * segment.nz + k)],
              samples[at], 2e-6);
        }
      }
    }
  }
}

TEST(SlabSampler, SlabsAndBandsCoverTheRows) {
  const auto field = uneven_field(FieldKind::kGrid);
  const SlabSampler sampler(*field, uneven_grid(), kFirstRow, kRows);
  EXPECT_EQ(sampler.rows_in_slab(0), 16);
  EXPECT_EQ(sampler.rows_in_slab(5), 10);
  ASSERT_EQ(sampler.num_bands(), 2);
  EXPECT_EQ(sampler.band(0).begin, 0);
  EXPECT_EQ(sampler.band(0).end, 4);
  EXPECT_EQ(sampler.band(1).begin, 4);
  EXPECT_EQ(sampler.band(1).end, 6);
  // Every leaf belongs to its band, and each band of whole cells uses all of its leaves.
  std::vector<int> all;
  for (int band = 0; band < 2; ++band) {
    for (const int leaf : sampler.leaves_of_band(band)) {
      EXPECT_EQ(field->tree().band_of_leaf(leaf), band);
      all.push_back(leaf);
    }
  }
  // In the second band, the rows end below the upper half of a split cell.
  EXPECT_EQ(all.size(), static_cast<std::size_t>(field->tree().num_leaves() - 2));
}

}  // namespace
}  // namespace tomofield::projection
