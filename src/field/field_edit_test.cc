#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "central_difference.h"
#include "field/field.h"
#include "field/vm/merge_factors.h"
#include "random_arrays.h"

namespace tomofield::field {
namespace {

using testing::random_floats;

constexpr double kThickness = 20.0;
// The vertex counts are odd and even: with odd ones, a vertex lies where the quarters meet.
constexpr LeafShape kShape{.nx = 7, .ny = 6, .nz = 5, .rank_x = 2, .rank_y = 3, .rank_z = 2};

std::unique_ptr<Field> one_cell(FieldKind kind, std::uint64_t seed) {
  const RootGrid roots{.x0 = -16, .y0 = 8, .cell_size = 64, .columns = 1, .rows = 1};
  auto field = make_field(kind, Quadtree(roots, {Region::kInterest}), kThickness, {kShape});
  field->initialise(base::Random(seed), 1.0);
  field->bias = 0.25f;
  return field;
}

// Returns the four quarters of one leaf with noise on their parameters. With much noise they have
// nothing in common, with little they are similar.
std::unique_ptr<Field> four_quarters(FieldKind kind, double noise) {
  auto field = one_cell(kind, 1);
  field->edit({.split = {0}, .merge = {}});
  const auto noises = random_floats(field->num_parameters(), 2, -noise, noise);
  for (std::size_t i = 0; i < noises.size(); ++i) field->parameters()[i] += noises[i];
  return field;
}

std::unique_ptr<Field> copy_of(const Field& field) {
  auto copy = make_field(field.kind(), field.tree(), field.thickness(), field.shapes());
  std::ranges::copy(field.parameters(), copy->parameters().begin());
  copy->bias = field.bias;
  return copy;
}

void merge_all(Field& field, const std::vector<base::AlignedBuffer<float>*>& moments = {}) {
  field.edit({.split = {}, .merge = {0}}, moments);
}

// Returns Σ over the quarters' vertices of (the leaf there − the quarter)².
double misfit(const Field& leaf, const Field& quarters) {
  double sum = 0.0;
  std::vector<float> from(kShape.vertices_xz()), to(from.size());
  for (int c = 0; c < 4; ++c) {
    const Square& square = quarters.tree().leaf(c).square;
    for (int j = 0; j < kShape.ny; ++j) {
      const double y = kPixelCentre + static_cast<double>(square.y0) +
                       static_cast<double>(square.size) * j / (kShape.ny - 1);
      quarters.row_values(c, y, from.data());
      leaf.row_values(0, y, to.data());
      for (int i = 0; i < kShape.nx; ++i) {
        const double x = 0.5 * (kShape.nx - 1) * (c & 1) + 0.5 * i;
        const int lower = std::min(static_cast<int>(x), kShape.nx - 2);
        for (int k = 0; k < kShape.nz; ++k) {
          const auto at = [&](int v) {
            return static_cast<double>(to[static_cast<std::size_t>(v * kShape.nz + k)]);
          };
          const double value = at(lower) + (x - lower) * (at(lower + 1) - at(lower));
          sum += std::pow(
              value - static_cast<double>(from[static_cast<std::size_t>(i * kShape.nz + k)]), 2);
        }
      }
    }
  }
  return sum;
}

// Returns the norm of the misfit's gradient with respect to the leaf's parameters. The misfit is
// quadratic in each parameter, so central differences are exact for any step.
double misfit_slope(Field& leaf, const Field& quarters) {
  double squares = 0.0;
  for (float& parameter : leaf.parameters()) {
    const double slope =
        testing::central_difference(parameter, 0.25f, [&] { return misfit(leaf, quarters); });
    squares += slope * slope;
  }
  return std::sqrt(squares);
}

class EachEditedField : public ::testing::TestWithParam<FieldKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, EachEditedField,
                         ::testing::Values(FieldKind::kVm, FieldKind::kGrid),
                         [](const auto& kind) { return base::name_of(kind.param); });

// Checks that a merge undoes a split, for parameters and moments.
TEST_P(EachEditedField, MergingTheQuartersOfALeafRestoresIt) {
  auto field = one_cell(GetParam(), 1);
  const auto before = copy_of(*field);
  base::AlignedBuffer<float> m(field->num_parameters()), v(field->num_parameters());
  std::ranges::copy(random_floats(m.size(), 5), m.begin());
  std::ranges::copy(random_floats(v.size(), 6, 0.0, 1.0), v.begin());
  const std::vector<float> old_m(m.begin(), m.end()), old_v(v.begin(), v.end());
  field->edit({.split = {0}, .merge = {}}, {&m, &v});
  EXPECT_EQ(field->tree().num_leaves(), 4);
  EXPECT_EQ(m.size(), field->num_parameters());
  merge_all(*field, {&m, &v});
  ASSERT_EQ(field->num_parameters(), before->num_parameters());
  const std::size_t count = count_parameters(GetParam(), {kShape});
  for (std::size_t i = 0; i < count; ++i) {
    ASSERT_NEAR(field->parameters()[i], before->parameters()[i], 3e-6) << i;
    ASSERT_NEAR(m[i], old_m[i], 1e-6) << i;
    ASSERT_NEAR(v[i], old_v[i], 1e-6) << i;
  }
}

// Checks that Adam's |m| <= √v survives. It does because both use the same weights (Jensen).
TEST_P(EachEditedField, MomentsStayInProportion) {
  const auto field = four_quarters(GetParam(), 1.0);
  base::AlignedBuffer<float> m(field->num_parameters()), v(field->num_parameters());
  std::ranges::copy(random_floats(m.size(), 5), m.begin());
  for (std::size_t i = 0; i < m.size(); ++i) v[i] = m[i] * m[i];
  const auto expect_proportion = [&] {
    for (std::size_t i = 0; i < m.size(); ++i) ASSERT_LE(m[i] * m[i], v[i] * 1.00001f) << i;
  };
  field->edit({.split = {0, 3}, .merge = {}}, {&m, &v});
  expect_proportion();
  field->edit({.split = {}, .merge = {field->tree().leaf(0).parent}}, {&m, &v});
  expect_proportion();
  EXPECT_EQ(field->tree().num_leaves(), 7);
}

TEST_P(EachEditedField, LeavesThatAreNotEditedKeepTheirBits) {
  const auto field = four_quarters(GetParam(), 0.5);
  const auto before = copy_of(*field);
  field->edit({.split = {1}, .merge = {}});
  const std::size_t count = count_parameters(GetParam(), {kShape});
  const auto leaf = [count](const Field& f, int i) {
    const auto values = f.parameters().subspan(f.offset(i), count);
    return std::vector<float>(values.begin(), values.end());
  };
  EXPECT_EQ(leaf(*field, 0), leaf(*before, 0));
  EXPECT_EQ(leaf(*field, 5), leaf(*before, 2));
  EXPECT_EQ(leaf(*field, 6), leaf(*before, 3));
}

TEST(MergedGrid, IsTheLeastSquaresFit) {
  const auto quarters = four_quarters(FieldKind::kGrid, 1.0);
  const auto merged = copy_of(*quarters);
  merge_all(*merged);
  const auto start = one_cell(FieldKind::kGrid, 9);
  EXPECT_LT(misfit_slope(*merged, *quarters), 1e-4 * misfit_slope(*start, *quarters));
  EXPECT_GT(misfit(*merged, *quarters), 1.0) << "the quarters are no leaf's";
}

TEST(MergedFactors, AreAStationaryPoint) {
  for (const double noise : {0.2, 2.0}) {
    const auto quarters = four_quarters(FieldKind::kVm, noise);
    const auto merged = copy_of(*quarters);
    merge_all(*merged);
    const auto start = one_cell(FieldKind::kVm, 9);
    EXPECT_LT(misfit_slope(*merged, *quarters), 0.03 * misfit_slope(*start, *quarters)) << noise;
    EXPECT_GT(misfit(*merged, *quarters), 1.0) << "the quarters are no leaf's";
  }
}

TEST(MergedFactors, FitBetterThanWhatTheQuartersCameFrom) {
  const auto quarters = four_quarters(FieldKind::kVm, 0.1);
  const auto merged = copy_of(*quarters);
  merge_all(*merged);
  const auto start = one_cell(FieldKind::kVm, 1);  // the quarters without the noise
  EXPECT_LT(misfit(*merged, *quarters), misfit(*start, *quarters));
}

RowMajorMatrix random_matrix(Eigen::Index rows, Eigen::Index columns, std::uint64_t seed) {
  const auto values = random_floats(static_cast<std::size_t>(rows * columns), seed);
  return Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
             values.data(), rows, columns)
      .cast<double>();
}

LeafFactors random_factors(const LeafShape& s, std::uint64_t seed) {
  return {random_matrix(s.nx, s.rank_x, seed),     random_matrix(s.nz * s.ny, s.rank_x, seed + 1),
          random_matrix(s.ny, s.rank_y, seed + 2), random_matrix(s.nx * s.nz, s.rank_y, seed + 3),
          random_matrix(s.nz, s.rank_z, seed + 4), random_matrix(s.nx * s.ny, s.rank_z, seed + 5)};
}

// Computes eq. 4 entry by entry.
RowMajorMatrix product_of(const LeafShape& s, const LeafFactors& f) {
  RowMajorMatrix b(s.nx, s.nz * s.ny);
  for (int x = 0; x < s.nx; ++x) {
    for (int z = 0; z < s.nz; ++z) {
      for (int y = 0; y < s.ny; ++y)
        b(x, z * s.ny + y) = f.vx.row(x).dot(f.myz.row(z * s.ny + y)) +
                             f.vy.row(y).dot(f.mxz.row(x * s.nz + z)) +
                             f.vz.row(z).dot(f.mxy.row(x * s.ny + y));
    }
  }
  return b;
}

TEST(FitFactors, FindsATargetOfTheirRanks) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const RowMajorMatrix b = product_of(kShape, random_factors(kShape, 10 * seed));
    LeafFactors factors = random_factors(kShape, 1000 * seed);
    const double left = fit_factors(b, factors);
    EXPECT_NEAR(left, (b - product_of(kShape, factors)).squaredNorm(), 1e-6 * b.squaredNorm());
    EXPECT_LT(left, 0.02 * b.squaredNorm()) << seed;
  }
}

TEST(FitFactors, TakesMoreRanksThanVertices) {
  LeafShape shape = kShape;
  shape.rank_x = shape.rank_y = shape.rank_z = 9;
  const RowMajorMatrix b = random_matrix(shape.nx, shape.nz * shape.ny, 3);
  LeafFactors factors = random_factors(shape, 4);
  factors.mxy.setZero();
  EXPECT_LT(fit_factors(b, factors), 1e-8 * b.squaredNorm());
}

// Returns the smallest misfit that any leaf can have, from the quarters' vertex values merged as a
// grid field.
double min_misfit(const Field& quarters) {
  const auto grid = make_field(FieldKind::kGrid, quarters.tree(), kThickness, quarters.shapes());
  grid->bias = quarters.bias;
  std::vector<float> row(kShape.vertices_xz());
  for (int c = 0; c < 4; ++c) {
    const Square& square = quarters.tree().leaf(c).square;
    for (int j = 0; j < kShape.ny; ++j) {
      quarters.row_values(c,
                          kPixelCentre + static_cast<double>(square.y0) +
                              static_cast<double>(square.size) * j / (kShape.ny - 1),
                          row.data());
      for (std::size_t i = 0; i < row.size(); ++i)
        grid->parameters()[grid->offset(c) + i * kShape.ny + static_cast<std::size_t>(j)] =
            row[i] - quarters.bias;
    }
  }
  merge_all(*grid);
  return misfit(*grid, quarters);
}

// Compares misfits above the smallest one, for quarters that are similar and for some that are not.
TEST(MergedFactors, AreNotWorseThanFromRandomStarts) {
  for (const double noise : {0.3, 2.0}) {
    const auto quarters = four_quarters(FieldKind::kVm, noise);
    const auto merged = copy_of(*quarters);
    merge_all(*merged);
    const double found = misfit(*merged, *quarters) - min_misfit(*quarters);
    const MergeTarget target = make_merge_target(*quarters, 0);
    std::vector<double> from_random;
    for (std::uint64_t seed = 0; seed < 9; ++seed) {
      LeafFactors factors = random_factors(kShape, 100 * seed);
      from_random.push_back(fit_factors(target.b, factors));
    }
    std::ranges::sort(from_random);
    EXPECT_LT(found, noise < 1 ? 1.1 * from_random.front() : from_random[4]) << noise;
  }
}

}  // namespace
}  // namespace tomofield::field
