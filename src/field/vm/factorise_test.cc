#include "field/vm/factorise.h"

#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "field/merge_target.h"
#include "field/vm/vm_field.h"

namespace tomofield::field {
namespace {

constexpr double kThickness = 20.0;
// The counts are unequal, so that a confusion of axes fails.
constexpr int kX = 7, kY = 6, kZ = 5;

LeafShape shape_of_ranks(int x, int y, int z) {
  return {.nx = kX, .ny = kY, .nz = kZ, .rank_x = x, .rank_y = y, .rank_z = z};
}

std::unique_ptr<Field> cells(int count, FieldKind kind, const LeafShape& shape) {
  const RootGrid roots{.x0 = -16, .y0 = 8, .cell_size = 64, .columns = count, .rows = 1};
  const auto number = static_cast<std::size_t>(count);
  auto field = make_field(kind, Quadtree(roots, std::vector(number, Region::kInterest)), kThickness,
                          std::vector(number, shape));
  field->initialise(base::Random(3), 1.0);
  field->bias = 0.25f;
  field->activation = {5.0f};
  return field;
}

std::unique_ptr<Field> one_cell(FieldKind kind, const LeafShape& shape) {
  return cells(1, kind, shape);
}

// Returns all vertex values of a leaf, [y, x·nz + z], without the bias.
std::vector<double> values_of(const Field& field, int leaf = 0) {
  const LeafShape& s = field.shape(leaf);
  const Square& square = field.tree().leaf(leaf).square;
  std::vector<double> all;
  std::vector<float> row(s.vertices_xz());
  for (int j = 0; j < s.ny; ++j) {
    const double y = kPixelCentre + static_cast<double>(square.y0) +
                     static_cast<double>(square.size) * j / (s.ny - 1);
    field.row_values(leaf, y, row.data());
    for (const float value : row) all.push_back(static_cast<double>(value - field.bias));
  }
  return all;
}

// Returns a grid field with the values of another field.
std::unique_ptr<Field> as_vertices(const Field& field) {
  const LeafShape& s = field.shape(0);
  auto vertices = one_cell(FieldKind::kGrid, s);
  const std::vector<double> values = values_of(field);
  for (std::size_t i = 0; i < s.vertices_xz(); ++i) {
    for (int j = 0; j < s.ny; ++j) {
      vertices->parameters()[i * static_cast<std::size_t>(s.ny) + static_cast<std::size_t>(j)] =
          static_cast<float>(values[static_cast<std::size_t>(j) * s.vertices_xz() + i]);
    }
  }
  return vertices;
}

double squared_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

double squared_error(const Field& vertices, const LeafShape& shape) {
  return squared_difference(values_of(*factorised(vertices, {shape})), values_of(vertices));
}

TEST(Factorise, IsExactIfOneAxisHasARankAVertex) {
  const auto vertices = one_cell(FieldKind::kGrid, shape_of_ranks(0, 0, 0));
  for (const LeafShape& shape : {shape_of_ranks(kX, 1, 2), shape_of_ranks(2, kY, 1),
                                 shape_of_ranks(1, 2, kZ), shape_of_ranks(kX + 3, kY + 1, kZ + 2)})
    EXPECT_LT(squared_error(*vertices, shape), 1e-9);
}

TEST(Factorise, FindsFactorsAlongOneAxis) {
  for (const LeafShape& shape :
       {shape_of_ranks(2, 0, 0), shape_of_ranks(0, 2, 0), shape_of_ranks(0, 0, 2)}) {
    const auto vertices = as_vertices(*one_cell(FieldKind::kVm, shape));
    EXPECT_LT(squared_error(*vertices, shape), 1e-9);
    EXPECT_LT(squared_error(*vertices, shape_of_ranks(2, 2, 2)), 1e-9);
  }
}

// Returns the sum of squares of the singular values beyond a rank, for values unfolded along an
// axis [n, others].
double square_beyond(const RowMajorMatrix& unfolded, Eigen::Index rank) {
  const Eigen::VectorXd singular = Eigen::JacobiSVD<Eigen::MatrixXd>(unfolded).singularValues();
  return singular.tail(singular.size() - rank).squaredNorm();
}

TEST(Factorise, IsTheBestOfItsRankAlongOneAxis) {
  const auto vertices = one_cell(FieldKind::kGrid, shape_of_ranks(0, 0, 0));
  RowMajorMatrix x(kX, kZ * kY), y(kY, kX * kZ), z(kZ, kX * kY);
  for (int i = 0; i < kX; ++i) {
    for (int k = 0; k < kZ; ++k) {
      for (int j = 0; j < kY; ++j) {
        const double value = static_cast<double>(
            vertices->parameters()[static_cast<std::size_t>((i * kZ + k) * kY + j)]);
        x(i, k * kY + j) = y(j, i * kZ + k) = z(k, i * kY + j) = value;
      }
    }
  }
  for (int rank = 1; rank < kZ; ++rank) {
    EXPECT_NEAR(squared_error(*vertices, shape_of_ranks(rank, 0, 0)), square_beyond(x, rank), 1e-5);
    EXPECT_NEAR(squared_error(*vertices, shape_of_ranks(0, rank, 0)), square_beyond(y, rank), 1e-5);
    EXPECT_NEAR(squared_error(*vertices, shape_of_ranks(0, 0, rank)), square_beyond(z, rank), 1e-5);
  }
}

TEST(Factorise, EachRankOfEachAxisHelps) {
  const auto vertices = one_cell(FieldKind::kGrid, shape_of_ranks(0, 0, 0));
  const double without = squared_error(*vertices, shape_of_ranks(2, 2, 2));
  for (const LeafShape& shape :
       {shape_of_ranks(3, 2, 2), shape_of_ranks(2, 3, 2), shape_of_ranks(2, 2, 3)})
    EXPECT_LT(squared_error(*vertices, shape), 0.95 * without);
}

TEST(Factorise, AVectorIsAsLargeAsItsMatrix) {
  const LeafShape shape = shape_of_ranks(3, 2, 2);
  const auto factors = factorised(*one_cell(FieldKind::kGrid, shape_of_ranks(0, 0, 0)), {shape});
  const VmLayout at(shape);
  const auto mean_square = [&](std::size_t first, std::size_t end, int rank, int r) {
    double sum = 0;
    for (std::size_t i = first + static_cast<std::size_t>(r); i < end;
         i += static_cast<std::size_t>(rank))
      sum += std::pow(static_cast<double>(factors->parameters()[i]), 2);
    return sum / (static_cast<double>(end - first) / rank);
  };
  const auto expect_alike = [&](std::size_t vector, std::size_t matrix, std::size_t end, int rank) {
    for (int r = 0; r < rank; ++r) {
      const double of_matrix = mean_square(matrix, end, rank, r);
      EXPECT_GT(of_matrix, 1e-4);
      EXPECT_NEAR(mean_square(vector, matrix, rank, r), of_matrix, 1e-5 * of_matrix);
    }
  };
  expect_alike(at.vx, at.myz, at.vy, shape.rank_x);
  expect_alike(at.vy, at.mxz, at.vz, shape.rank_y);
  expect_alike(at.vz, at.mxy, at.count, shape.rank_z);
}

TEST(Factorise, RanksWithNothingToHoldAreZero) {
  auto vertices = one_cell(FieldKind::kGrid, shape_of_ranks(0, 0, 0));
  std::ranges::fill(vertices->parameters(), 0.0f);
  for (const LeafShape& shape : {shape_of_ranks(2, 3, 2), shape_of_ranks(kX + 1, kY + 1, kZ + 1)}) {
    const auto factors = factorised(*vertices, {shape});
    EXPECT_TRUE(std::ranges::all_of(factors->parameters(), [](float p) { return p == 0.0f; }));
  }
}

TEST(Factorise, KeepsTheDecoderAndTheLeavesThatAreKept) {
  auto vertices = cells(3, FieldKind::kGrid, shape_of_ranks(0, 0, 0));
  vertices->keep_only({2});
  const LeafShape shape = shape_of_ranks(kX, 1, 1);
  const auto factors = factorised(*vertices, {shape, shape, shape});
  EXPECT_EQ(factors->kind(), FieldKind::kVm);
  EXPECT_EQ(factors->bias, vertices->bias);
  EXPECT_EQ(factors->activation.beta, vertices->activation.beta);
  EXPECT_TRUE(factors->keeps(2) && !factors->keeps(0) && !factors->keeps(1));
  const auto own = factors->parameters().subspan(factors->offset(2));
  const auto others = factors->parameters().first(factors->offset(2));
  EXPECT_TRUE(std::ranges::all_of(others, [](float p) { return p == 0.0f; }));
  EXPECT_TRUE(std::ranges::any_of(own, [](float p) { return p != 0.0f; }));
  EXPECT_LT(squared_difference(values_of(*factors, 2), values_of(*vertices, 2)), 1e-9);
}

}  // namespace
}  // namespace tomofield::field
