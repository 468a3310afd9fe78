#include "compact/compress.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "base/progress.h"
#include "base/random.h"
#include "compact/decoded_field.h"
#include "compact/sample_coded.h"
#include "compact/vertex_densities.h"
#include "field/sampling/sample_box.h"
#include "tomofield/error.h"

namespace tomofield::compact {
namespace {

using field::Field;
using field::Region;

constexpr double kThickness = 24.0;

// Returns a row of cells of 32 px: a margin on the left whose vertices are 4 px apart, then
// `inside` cells with a vertex a pixel. Its first half has texture, and its second half is empty.
std::unique_ptr<Field> half_empty_field(int inside) {
  const field::RootGrid roots{
      .x0 = -32, .y0 = 0, .cell_size = 32, .columns = inside + 1, .rows = 1};
  std::vector<Region> regions(static_cast<std::size_t>(inside + 1), Region::kInterest);
  regions[0] = Region::kMargin;
  std::vector<field::LeafShape> shapes(regions.size(), {.nx = 33, .ny = 33, .nz = 24});
  shapes[0] = {.nx = 9, .ny = 9, .nz = 7};
  auto field =
      field::make_field(FieldKind::kGrid, field::Quadtree(roots, regions), kThickness, shapes);
  base::Random random(7);
  for (int leaf = 0; leaf < field->tree().num_leaves(); ++leaf) {
    const field::LeafShape& s = field->shape(leaf);
    const field::Square& square = field->tree().leaf(leaf).square;
    float* value = field->parameters().data() + field->offset(leaf);
    for (int i = 0; i < s.nx; ++i) {
      for (int k = 0; k < s.nz; ++k) {
        for (int j = 0; j < s.ny; ++j) {
          const double x = static_cast<double>(square.x0) + 32.0 * i / (s.nx - 1);
          const double y = 32.0 * j / (s.ny - 1), z = 23.0 * k / (s.nz - 1);
          const double texture = 1 + std::sin(0.4 * x + 0.1 * z) * std::cos(0.3 * y - 0.2 * z) +
                                 random.uniform(-0.3, 0.3);
          *value++ = static_cast<float>(x < 16.0 * inside ? texture : 0.0);
        }
      }
    }
  }
  return field;
}

// Returns the cells inside, which are the region of interest.
Rectangle region_of(int inside) { return {.x0 = 0, .y0 = 0, .x1 = 32 * inside, .y1 = 32}; }

// Returns the mean squared difference of two fields at the voxels of the region of interest.
double mean_square_difference(const Field& a, const Field& b, int inside) {
  const field::OrientedBox box =
      field::box_between({0, 0, 0}, {32.0 * inside, 32, kThickness}, 1.0);
  const std::vector<float> of_a = field::sample_box(a, box), of_b = field::sample_box(b, box);
  double square = 0;
  for (std::size_t i = 0; i < of_a.size(); ++i)
    square += std::pow(static_cast<double>(of_a[i] - of_b[i]), 2);
  return square / static_cast<double>(of_a.size());
}

TEST(Compress, DecibelsAreKept) {
  constexpr int kInside = 4;
  const auto vertices = half_empty_field(kInside);
  double last = 0;
  for (const double decibels : {0.5, 0.1}) {
    const CompactField made =
        compress(*vertices, region_of(kInside), {Budget::Kind::kDecibels, decibels});
    EXPECT_LE(made.report.decibels, decibels);
    EXPECT_GE(made.report.decibels, 0.8 * decibels);
    // The report's error is at vertices, whose upper faces lie beyond the region.
    const double change = mean_square_difference(*vertices, *made.field, kInside);
    EXPECT_NEAR(change / made.report.mean_square_change, 1, 0.35);
    EXPECT_GT(static_cast<double>(made.report.parameters), last);
    last = static_cast<double>(made.report.parameters);
  }
}

// The variance of a field without contrast is what floats can tell.
TEST(Compress, AFieldOfOneDensityIsKept) {
  const auto vertices = half_empty_field(1);
  std::ranges::fill(vertices->parameters(), 5.0f);
  for (const double decibels : {1.0, 0.02}) {
    const CompactField made =
        compress(*vertices, region_of(1), {Budget::Kind::kDecibels, decibels});
    EXPECT_LE(made.report.decibels, decibels);
    EXPECT_NEAR(made.field->density(10.3, 11.4, 12.5), 5, 1e-4);
  }
}

// A model grows by whole components, so it fills small budgets less well: it is empty if the budget
// is less than one component, and a budget of 4e3 bytes is filled to 0.6.
TEST(Compress, ParametersAndBytesAreKept) {
  const auto vertices = half_empty_field(4);
  for (const double parameters : {4e3, 2e4}) {
    const CompactField made =
        compress(*vertices, region_of(4), {Budget::Kind::kParameters, parameters});
    EXPECT_LE(static_cast<double>(made.report.parameters), parameters);
    EXPECT_GT(static_cast<double>(made.report.parameters), 0.8 * parameters);
  }
  for (const double bytes : {5e3, 2e4}) {
    const CompactField made = compress(*vertices, region_of(4), {Budget::Kind::kBytes, bytes});
    EXPECT_LE(static_cast<double>(made.report.bytes), bytes);
    EXPECT_GT(static_cast<double>(made.report.bytes), 0.8 * bytes);
  }
}

// A budget that has room for every component makes the closest model there is.
TEST(Compress, ABudgetAboveTheFieldKeepsTheFieldClosely) {
  const auto vertices = half_empty_field(4);
  const double parameters = static_cast<double>(vertices->parameters().size());
  for (const Budget& budget : {Budget{Budget::Kind::kParameters, 10 * parameters},
                               {Budget::Kind::kBytes, 2 * parameters},
                               {Budget::Kind::kBytes, 100 * parameters}}) {
    const CompressionReport report = compress(*vertices, region_of(4), budget).report;
    EXPECT_LT(report.decibels, 0.001) << budget.amount;
    EXPECT_LE(static_cast<double>(report.parameters), 10 * parameters);
  }
}

// Compression of a large model takes minutes, and a signal is obeyed in each of its parts.
TEST(Compress, AStopIsObeyedAtAnyTime) {
  const auto vertices = half_empty_field(4);
  std::atomic<int> calls{0}, last{std::numeric_limits<int>::max()};
  base::set_loop_interruption([&] {
    if (++calls > last) throw base::StopRequested{};
  });
  const auto run = [&] { compress(*vertices, region_of(4), {Budget::Kind::kBytes, 2e4}); };
  run();
  const int whole = calls;
  for (const double part : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9}) {
    calls = 0;
    last = static_cast<int>(part * whole);
    EXPECT_THROW(run(), base::StopRequested) << part;
  }
  base::set_loop_interruption({});
}

TEST(Compress, BytesAreThoseOfTheFile) {
  const auto vertices = half_empty_field(4);
  constexpr double kBytes = 2e4, kBeside = 8e3;
  const auto file_size = [&](const CodedField& coded) {
    return static_cast<std::size_t>(kBeside) + coded.codes.bytes.size();
  };
  const auto made = [&](double bytes) {
    return compress(*vertices, region_of(4), {Budget::Kind::kBytes, bytes}, file_size).report;
  };
  EXPECT_LE(static_cast<double>(made(kBytes).bytes), kBytes - kBeside);
  EXPECT_GT(static_cast<double>(made(kBytes).bytes), 0.8 * (kBytes - kBeside));
  EXPECT_THROW(made(kBeside - 1), Error);
}

TEST(Compress, BudgetsThatCannotBeMetAreRefused) {
  const auto vertices = half_empty_field(1);
  const auto made = [&](Budget::Kind kind, double amount) {
    return compress(*vertices, region_of(1), {kind, amount}).report;
  };
  EXPECT_THROW(made(Budget::Kind::kParameters, 1), Error) << "an empty model is another tomogram";
  EXPECT_THROW(made(Budget::Kind::kParameters, -1), Error);
  EXPECT_THROW(made(Budget::Kind::kBytes, -1), Error);
}

TEST(Compress, EmptyRegionsAreLargeLeavesWithoutParameters) {
  const auto vertices = half_empty_field(16);
  const CompactField made = compress(*vertices, region_of(16), {Budget::Kind::kDecibels, 0.1});
  const field::Quadtree& tree = made.field->tree();
  const int textured = tree.find_leaf(40, 10), empty = tree.find_leaf(500, 10);
  EXPECT_GT(made.coded.codes.code(textured).size(), 100u);
  EXPECT_TRUE(made.coded.codes.code(empty).empty());
  EXPECT_LE(tree.leaf(textured).square.size, 32);
  EXPECT_EQ(made.field->density(500.2, 10.1, 12.3), 0.0);
}

// A region that ends inside a leaf: what lies beyond it, the margin as well, takes no parameters.
TEST(Compress, TheFieldIsEmptyBeyondTheRegion) {
  const auto vertices = half_empty_field(4);
  const Rectangle roi{.x0 = 0, .y0 = 0, .x1 = 40, .y1 = 32};
  const Budget budget{Budget::Kind::kDecibels, 0.1};
  const CompactField made = compress(*vertices, roi, budget);
  EXPECT_EQ(made.report.volume, 40 * 32 * kThickness);
  EXPECT_EQ(made.field->density(-20, 10, 12), 0.0);
  EXPECT_EQ(made.field->density(60, 10, 12), 0.0);
  EXPECT_NEAR(made.field->density(39.5, 10, 12), vertices->density(39.5, 10, 12), 0.3);
  EXPECT_LT(made.report.parameters, compress(*vertices, region_of(2), budget).report.parameters);
}

// A vertex next to the region is kept, but it does not count to the region's mean and variance.
TEST(Compress, TheVarianceIsThatOfTheRegion) {
  const auto field = half_empty_field(4);
  base::Random random(11);
  for (float& value : field->parameters()) value = static_cast<float>(5 + random.normal());
  for (const Rectangle roi : {Rectangle{0, 0, 40, 32}, {3, 5, 41, 23}, {40, 8, 60, 20}})
    EXPECT_NEAR(variance_of(*field, roi), 1, 0.07) << roi.x0;
}

// Two bands are made compact one after the other, as tiles of a run are.
TEST(Compress, PartsJoinToTheWholeField) {
  const field::RootGrid roots{.x0 = 0, .y0 = 0, .cell_size = 32, .columns = 1, .rows = 2};
  const field::LeafShape shape{.nx = 33, .ny = 33, .nz = 24};
  const auto field = field::make_field(
      FieldKind::kGrid, field::Quadtree(roots, {Region::kInterest, Region::kInterest}), kThickness,
      {shape, shape});
  base::Random random(3);
  for (float& value : field->parameters()) value = static_cast<float>(random.uniform(0, 1));
  const Rectangle roi{.x0 = 0, .y0 = 0, .x1 = 32, .y1 = 64};
  const double variance = variance_of(*field, roi);
  EXPECT_NEAR(variance, 1.0 / 12, 0.01);
  const Budget budget{Budget::Kind::kDecibels, 1};
  CompactField both = compress(*field, roi, budget, {0, 32}, variance);
  const CompactField upper = compress(*field, roi, budget, {32, 64}, variance);
  append(both.coded, upper.coded);
  const CompressionReport report = joined(both.report, upper.report);
  EXPECT_EQ(report.parameters, both.coded.codes.num_parameters());
  EXPECT_EQ(report.bytes, both.coded.codes.bytes.size());
  EXPECT_DOUBLE_EQ(report.volume, 32 * 64 * kThickness);
  const auto made = decode_field(both.coded);
  const field::OrientedBox box = field::box_between({0, 0, 0}, {32, 64, kThickness}, 1.0);
  const std::vector<float> before = field::sample_box(*field, box);
  std::vector<float> after = field::sample_box(*made, box);
  double square = 0;
  for (std::size_t i = 0; i < before.size(); ++i)
    square += std::pow(static_cast<double>(before[i] - after[i]), 2);
  // The leaves of this field have other values where they share a face, and codes have their mean.
  EXPECT_NEAR(square / static_cast<double>(before.size()) / report.mean_square_change, 1, 0.35);

  // Few bands are decoded at a time.
  std::vector<float> by_bands(after.size());
  sample_box(both.coded, box, [&](const field::BoxPart& part) {
    const auto rows = static_cast<std::ptrdiff_t>(part.num_rows * box.size[0]);
    for (std::int64_t s = 0; s < part.num_sections; ++s)
      std::copy_n(part.values.begin() + s * rows, rows,
                  by_bands.begin() +
                      ((part.first_section + s) * box.size[1] + part.first_row) * box.size[0]);
  });
  EXPECT_EQ(by_bands, after);
}

// Where leaves meet at a face, the square that begins there reads the mean of their values.
TEST(VertexDensities, AverageAtFaces) {
  const auto field = half_empty_field(2);
  for (float& value : field->parameters().subspan(field->offset(2))) value += 0.5f;
  const VertexDensities vertices(*field, region_of(2));
  EXPECT_EQ(vertices.smallest_side(), 16);
  const PlaceDensities left = vertices.read({0, 0, 32}), right = vertices.read({32, 0, 16});
  EXPECT_EQ(left.nx, 32);
  EXPECT_EQ(right.ny, 16);
  for (int k = 0; k < right.nz; ++k) {
    for (int j = 0; j < right.ny; ++j) {
      const auto vertex = [&](int leaf, int i) {
        const field::LeafShape& s = field->shape(leaf);
        return field->parameters()[field->offset(leaf) +
                                   (static_cast<std::size_t>(i) * s.nz + k) * s.ny + j];
      };
      EXPECT_FLOAT_EQ(right.values(0, k * right.ny + j), (vertex(1, 32) + vertex(2, 0)) / 2);
    }
  }
  const PlaceDensities cut = VertexDensities(*field, {2, 3, 10, 7}).read({0, 0, 32});
  EXPECT_EQ(cut.inside_x, (base::Range{2, 10}));
  EXPECT_EQ(cut.inside_y, (base::Range{3, 7}));
  EXPECT_EQ(cut.values(10, 7), left.values(10, 7)) << "the last voxel depends on it";
  EXPECT_EQ(cut.values(11, 5), 0);
  EXPECT_EQ(cut.volume(), 8 * 4 * kThickness);
  EXPECT_EQ(vertices.leaf_like({-32, 0, 64}), -1) << "margin and region";
  EXPECT_TRUE(vertices.is_outside({64, 0, 32}));
  EXPECT_FALSE(vertices.is_outside({32, 0, 64}));
}

}  // namespace
}  // namespace tomofield::compact
