#include "field/field.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "base/threads/parallel.h"
#include "central_difference.h"
#include "field/array_variation.h"
#include "random_arrays.h"
#include "tomofield/error.h"

namespace tomofield::field {
namespace {

using kernels::kLanes;
using testing::expect_near;
using testing::random_floats;

constexpr double kThickness = 37.5;

// Vertex counts and ranks are unequal, even and odd, so that a confusion of axes fails.
constexpr LeafShape kFine{.nx = 5, .ny = 4, .nz = 7, .rank_x = 3, .rank_y = 1, .rank_z = 2};
constexpr LeafShape kCoarse{.nx = 3, .ny = 2, .nz = 4, .rank_x = 1, .rank_y = 2, .rank_z = 1};

// Returns a fine cell beside a coarse one, with random parameters.
std::unique_ptr<Field> two_cells(FieldKind kind, float beta, const LeafShape& fine = kFine) {
  const RootGrid roots{.x0 = -16, .y0 = 8, .cell_size = 64, .columns = 2, .rows = 1};
  auto field = make_field(kind, Quadtree(roots, {Region::kInterest, Region::kMargin}), kThickness,
                          {fine, kCoarse});
  field->initialise(base::Random(3), 1.0);
  field->bias = 0.25f;
  field->activation = {beta};
  return field;
}

// Computes eq. 4 at a vertex in double, from the parameter layout that the headers state.
double vertex_value(const Field& field, int leaf, int x, int y, int z) {
  const LeafShape& s = field.shape(leaf);
  const float* at = field.parameters().data() + field.offset(leaf);
  const auto take = [&at](int n0, int n1, int n2) {
    const float* factor = at;
    at += n0 * n1 * n2;
    return [=](int i0, int i1, int i2) {
      return static_cast<double>(factor[(i0 * n1 + i1) * n2 + i2]);
    };
  };
  if (field.kind() == FieldKind::kGrid) return take(s.nx, s.nz, s.ny)(x, z, y);
  const auto vx = take(1, s.nx, s.rank_x), myz = take(s.nz, s.ny, s.rank_x);
  const auto vy = take(1, s.ny, s.rank_y), mxz = take(s.nx, s.nz, s.rank_y);
  const auto vz = take(1, s.nz, s.rank_z), mxy = take(s.nx, s.ny, s.rank_z);
  double sum = 0.0;
  for (int r = 0; r < s.rank_x; ++r) sum += vx(0, x, r) * myz(z, y, r);
  for (int r = 0; r < s.rank_y; ++r) sum += vy(0, y, r) * mxz(x, z, r);
  for (int r = 0; r < s.rank_z; ++r) sum += vz(0, z, r) * mxy(x, y, r);
  return sum;
}

struct Position {
  int lower;
  double fraction;
  // Places `position`, from 0 to 1, among n vertices.
  Position(double position, int n) {
    double vertex = position * (n - 1);
    // Beyond the outer vertices, their values continue.
    vertex = std::clamp(vertex, 0.0, n - 1.0);
    lower = std::min(static_cast<int>(vertex), n - 2);
    fraction = vertex - lower;
  }
  double weight(int upper) const { return upper ? fraction : 1.0 - fraction; }
};

// Returns the value at (x vertex, y, z vertex), bias included.
double value_at_row(const Field& field, int leaf, int x, double y, int z) {
  const Square& square = field.tree().leaf(leaf).square;
  const Position at((y - 0.5 - static_cast<double>(square.y0)) / static_cast<double>(square.size),
                    field.shape(leaf).ny);
  double sum = static_cast<double>(field.bias);
  for (const int j : {0, 1}) sum += at.weight(j) * vertex_value(field, leaf, x, at.lower + j, z);
  return sum;
}

// Returns the density that one leaf gives, also on its last faces.
double expected_density(const Field& field, int leaf, double x, double y, double z) {
  const Square& square = field.tree().leaf(leaf).square;
  const LeafShape& s = field.shape(leaf);
  const Position px((x - 0.5 - static_cast<double>(square.x0)) / static_cast<double>(square.size),
                    s.nx);
  const Position pz((z - 0.5) / (field.thickness() - 1), s.nz);
  double a = 0.0;
  for (const int i : {0, 1}) {
    for (const int k : {0, 1})
      a += px.weight(i) * pz.weight(k) * value_at_row(field, leaf, px.lower + i, y, pz.lower + k);
  }
  const double beta = static_cast<double>(field.activation.beta);
  return beta == 0.0 ? a : std::log1p(std::exp(beta * a)) / beta;
}

double expected_density(const Field& field, double x, double y, double z) {
  return expected_density(field, field.tree().find_leaf(x, y), x, y, z);
}

// Returns rows of a leaf from its first face to its last, and some outside of it.
std::array<double, kLanes> rows_of(const Square& square) {
  std::array<double, kLanes> y{};
  for (std::size_t l = 0; l < kLanes; ++l)
    y[l] = static_cast<double>(square.y0) + 0.5 +
           static_cast<double>(square.size) * static_cast<double>(l) / 15.0;
  return y;
}

// Returns the rows of 16 pixels in a leaf.
std::array<double, kLanes> pixels_of(const Square& square) {
  std::array<double, kLanes> y{};
  for (std::size_t l = 0; l < kLanes; ++l)
    y[l] = static_cast<double>(square.y0) + 20.5 + static_cast<double>(l);
  return y;
}

using RowsOfLeaf = std::function<std::array<double, kLanes>(const Square&)>;

class EachField : public ::testing::TestWithParam<FieldKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, EachField, ::testing::Values(FieldKind::kVm, FieldKind::kGrid),
                         [](const auto& kind) { return base::name_of(kind.param); });

TEST_P(EachField, SlabValuesAreEquation4) {
  const auto field = two_cells(GetParam(), 0.0f);
  for (int leaf = 0; leaf < 2; ++leaf) {
    const LeafShape& s = field->shape(leaf);
    const auto y = rows_of(field->tree().leaf(leaf).square);
    std::vector<float> values(s.vertices_xz() * kLanes, 99.0f);
    field->slab_values(leaf, field->lane_rows(leaf, y), values.data());
    std::vector<double> expected;
    for (int x = 0; x < s.nx; ++x) {
      for (int z = 0; z < s.nz; ++z) {
        for (const double row : y) expected.push_back(value_at_row(*field, leaf, x, row, z));
      }
    }
    expect_near(values, expected, 2e-6);
  }
}

TEST_P(EachField, RowValuesAreEquation4) {
  const auto field = two_cells(GetParam(), 0.0f);
  for (int leaf = 0; leaf < 2; ++leaf) {
    const LeafShape& s = field->shape(leaf);
    for (const double y : {8.0, 8.5, 40.0, 55.25, 72.0}) {
      std::vector<float> values(s.vertices_xz(), 99.0f);
      field->row_values(leaf, y, values.data());
      std::vector<double> expected;
      for (int x = 0; x < s.nx; ++x) {
        for (int z = 0; z < s.nz; ++z) expected.push_back(value_at_row(*field, leaf, x, y, z));
      }
      expect_near(values, expected, 2e-6);
    }
  }
}

TEST_P(EachField, DensityIsTheActivatedInterpolation) {
  for (const float beta : {0.0f, 4.0f}) {
    const auto field = two_cells(GetParam(), beta);
    base::Random random(5);
    for (int n = 0; n < 500; ++n) {
      const double x = random.uniform(-16, 112), y = random.uniform(8, 72);
      const double z = random.uniform(0, kThickness);
      EXPECT_NEAR(field->density(x, y, z), expected_density(*field, x, y, z), 2e-6);
    }
    EXPECT_NEAR(field->density(-16, 8, 0), expected_density(*field, -16, 8, 0), 2e-6);
    EXPECT_NEAR(field->density(0, 9, kThickness), expected_density(*field, 0, 9, kThickness), 2e-6);
  }
}

// Calls visit(x, y, z) at points all over two_cells.
template <typename Visit>
void for_each_point(Visit&& visit) {
  base::Random random(8);
  for (int n = 0; n < 300; ++n)
    visit(random.uniform(-15, 112), random.uniform(9, 72), random.uniform(0.5, kThickness - 0.5));
}

LeafShape with_vertices(LeafShape shape, int nx, int ny, int nz) {
  shape.nx = nx;
  shape.ny = ny;
  shape.nz = nz;
  return shape;
}

TEST_P(EachField, MoreVerticesBetweenThoseThatAreThereChangeNothing) {
  const auto field = two_cells(GetParam(), 4.0f);
  const auto finer = field->resampled({with_vertices(kFine, 9, 10, 13),  // 2, 3 and 2 times finer
                                       with_vertices(kCoarse, 9, 5, 4)});
  EXPECT_GT(finer->num_parameters(), 2 * field->num_parameters());
  for_each_point([&](double x, double y, double z) {
    ASSERT_NEAR(finer->density(x, y, z), field->density(x, y, z), 2e-6);
  });
}

TEST_P(EachField, FewerVerticesTakeTheValuesThatAreThere) {
  const auto field = two_cells(GetParam(), 0.0f);
  const auto coarser = field->resampled({with_vertices(kFine, 4, 3, 5), kCoarse});
  const Square square = field->tree().leaf(0).square;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 5; ++k) {
        const double x = static_cast<double>(square.x0) + 0.5 + 64.0 * i / 3 - 1e-9 * (i == 3);
        const double y = static_cast<double>(square.y0) + 0.5 + 32.0 * j - 1e-9 * (j == 2);
        const double z = 0.5 + (kThickness - 1) * k / 4;
        EXPECT_NEAR(coarser->density(x, y, z), field->density(x, y, z), 3e-6);
      }
    }
  }
}

TEST_P(EachField, DensityOutsideTheDomainIsZero) {
  const auto field = two_cells(GetParam(), 4.0f);
  EXPECT_GT(field->density(0, 20, 10), 0.0);
  EXPECT_EQ(field->density(-16.01, 20, 10), 0.0);
  EXPECT_EQ(field->density(112.5, 20, 10), 0.0);
  EXPECT_EQ(field->density(0, 7.9, 10), 0.0);
  EXPECT_EQ(field->density(0, 72.5, 10), 0.0);
  EXPECT_EQ(field->density(0, 20, -0.01), 0.0);
  EXPECT_EQ(field->density(0, 20, kThickness + 0.01), 0.0);
  EXPECT_EQ(field->density(0, 20, std::nan("")), 0.0);
}

// Compares with central differences. Values are linear in each single parameter, so central
// differences of any step are the derivative to rounding.
void expect_slab_gradient_is_the_derivative(Field* field, const RowsOfLeaf& rows_of_leaf) {
  for (int leaf = 0; leaf < 2; ++leaf) {
    const std::size_t size = field->shape(leaf).vertices_xz() * kLanes;
    const auto rows = field->lane_rows(leaf, rows_of_leaf(field->tree().leaf(leaf).square));
    const auto weights = random_floats(size, 7);
    const auto objective = [&] {
      std::vector<float> values(size);
      field->slab_values(leaf, rows, values.data());
      return testing::dot(weights, values);
    };
    const std::size_t count = field->offset(leaf + 1) - field->offset(leaf);
    const auto before = random_floats(count, 8);
    std::vector<float> gradient = before;
    field->slab_gradient(leaf, rows, weights.data(), gradient.data());
    std::vector<double> expected;
    for (std::size_t i = 0; i < count; ++i) {
      float& p = field->parameters()[field->offset(leaf) + i];
      expected.push_back(static_cast<double>(before[i]) +
                         testing::central_difference(p, 1.0f, objective));
    }
    expect_near(gradient, expected, 2e-5);
  }
}

TEST_P(EachField, SlabGradientIsTheDerivative) {
  expect_slab_gradient_is_the_derivative(two_cells(GetParam(), 0.0f).get(), rows_of);
}

TEST_P(EachField, SlabGradientAtVerticesIsTheDerivative) {
  LeafShape fine = kFine;
  fine.ny = 64 + 1;
  expect_slab_gradient_is_the_derivative(two_cells(GetParam(), 0.0f, fine).get(), pixels_of);
}

// Random points of a leaf, its corners included.
struct RandomPoints {
  std::vector<double> x, y, z;
  RandomPoints(const Field& field, int leaf, int count) {
    base::Random random(11);
    const Square& s = field.tree().leaf(leaf).square;
    for (int n = 0; n < count; ++n) {
      const auto at = [&](double low, double high, int bit) {
        return n >= 8 ? random.uniform(low, high) : n >> bit & 1 ? high : low;
      };
      x.push_back(at(static_cast<double>(s.x0), static_cast<double>(s.x1()), 0));
      y.push_back(at(static_cast<double>(s.y0), static_cast<double>(s.y1()), 1));
      z.push_back(at(0, field.thickness(), 2));
    }
  }
  Points points() const { return {x, y, z}; }
};

TEST_P(EachField, PointDensitiesAreOneLeafsOnItsFacesToo) {
  for (const float beta : {0.0f, 4.0f}) {
    const auto field = two_cells(GetParam(), beta);
    for (int leaf = 0; leaf < 2; ++leaf) {
      const RandomPoints p(*field, leaf, 200);
      std::vector<float> densities(p.x.size(), 99.0f);
      field->point_densities(leaf, p.points(), densities);
      std::vector<double> expected;
      for (std::size_t n = 0; n < p.x.size(); ++n)
        expected.push_back(expected_density(*field, leaf, p.x[n], p.y[n], p.z[n]));
      expect_near(densities, expected, 2e-6);
    }
  }
}

// The expected densities are in double and read the parameters directly. Central differences with a
// step that is a power of two are therefore exact but for the activation's curvature.
TEST_P(EachField, PointGradientIsTheDerivative) {
  for (const float beta : {0.0f, 4.0f}) {
    const auto field = two_cells(GetParam(), beta);
    for (int leaf = 0; leaf < 2; ++leaf) {
      const RandomPoints p(*field, leaf, 60);
      const auto weights = random_floats(p.x.size(), 7);
      const auto objective = [&] {
        double sum = 0.0;
        for (std::size_t n = 0; n < p.x.size(); ++n)
          sum += static_cast<double>(weights[n]) *
                 expected_density(*field, leaf, p.x[n], p.y[n], p.z[n]);
        return sum;
      };
      const auto derivative = [&](float& parameter) {
        return testing::central_difference(parameter, 1.0f / 4096, objective);
      };
      const std::size_t count = field->offset(leaf + 1) - field->offset(leaf);
      const auto before = random_floats(count, 8);
      std::vector<float> densities(p.x.size()), gradient = before;
      field->point_densities(leaf, p.points(), densities);
      const double grad_bias =
          field->point_gradient(leaf, p.points(), densities, weights, gradient.data());
      EXPECT_NEAR(grad_bias, derivative(field->bias), 2e-6);
      std::vector<double> expected;
      for (std::size_t i = 0; i < count; ++i)
        expected.push_back(static_cast<double>(before[i]) +
                           derivative(field->parameters()[field->offset(leaf) + i]));
      expect_near(gradient, expected, 3e-6);
    }
  }
}

// One factor, [n0, n1, channels], or a volume of vertices.
struct VariedArray {
  std::array<int, 3> n;
  int channels;
  double weight;
  std::size_t size() const { return static_cast<std::size_t>(n[0] * n[1] * n[2] * channels); }
};

std::vector<VariedArray> varied_arrays(FieldKind kind, const LeafShape& s) {
  if (kind == FieldKind::kGrid) return {{{s.nx, s.nz, s.ny}, 1, 1.0}};
  constexpr double kAlpha = 0.1;  // eq. 5
  return {{{1, 1, s.nx}, s.rank_x, kAlpha}, {{1, s.nz, s.ny}, s.rank_x, 1.0},
          {{1, 1, s.ny}, s.rank_y, kAlpha}, {{1, s.nx, s.nz}, s.rank_y, 1.0},
          {{1, 1, s.nz}, s.rank_z, kAlpha}, {{1, s.nx, s.ny}, s.rank_z, 1.0}};
}

double expected_variation(const std::vector<VariedArray>& arrays,
                          const kernels::VariationPenalty& penalty, const double* p) {
  double total = 0.0;
  for (const VariedArray& a : arrays) {
    const auto at = [&](int i, int j, int k, int c) {
      return p[((i * a.n[1] + j) * a.n[2] + k) * a.channels + c];
    };
    for (int i = 0; i < a.n[0]; ++i) {
      for (int j = 0; j < a.n[1]; ++j) {
        for (int k = 0; k < a.n[2]; ++k) {
          for (int c = 0; c < a.channels; ++c) {
            const double here = at(i, j, k, c);
            const double d0 = i + 1 < a.n[0] ? at(i + 1, j, k, c) - here : 0.0;
            const double d1 = j + 1 < a.n[1] ? at(i, j + 1, k, c) - here : 0.0;
            const double d2 = k + 1 < a.n[2] ? at(i, j, k + 1, c) - here : 0.0;
            const double epsilon = static_cast<double>(penalty.epsilon);
            const double tau = static_cast<double>(penalty.concavity);
            const double m = std::sqrt(d0 * d0 + d1 * d1 + d2 * d2 + epsilon * epsilon);
            total += a.weight * (tau > 0 ? tau * std::log(1.0 + m / tau) : m);
          }
        }
      }
    }
    p += a.size();
  }
  return total;
}

TEST_P(EachField, ParameterVariationAndItsDerivative) {
  const auto field = two_cells(GetParam(), 0.0f);
  constexpr double kWeight = 0.7;
  for (const float concavity : {0.0f, 0.3f}) {
    const kernels::VariationPenalty penalty{.epsilon = 0.02f, .concavity = concavity};
    for (int leaf = 0; leaf < 2; ++leaf) {
      const auto arrays = varied_arrays(GetParam(), field->shape(leaf));
      const std::size_t count = field->offset(leaf + 1) - field->offset(leaf);
      const auto before = random_floats(count, 8);
      std::vector<float> gradient = before;
      const double value = field->parameter_variation(leaf, penalty, kWeight, gradient.data());
      const auto own = field->parameters().subspan(field->offset(leaf), count);
      std::vector<double> p(own.begin(), own.end());
      const double found = kWeight * expected_variation(arrays, penalty, p.data());
      EXPECT_NEAR(value, found, 1e-6 * found);
      std::vector<double> expected;
      for (std::size_t i = 0; i < count; ++i) {
        const double kept = p[i];
        p[i] = kept + 1e-5;
        const double high = expected_variation(arrays, penalty, p.data());
        p[i] = kept - 1e-5;
        const double low = expected_variation(arrays, penalty, p.data());
        p[i] = kept;
        expected.push_back(static_cast<double>(before[i]) + kWeight * (high - low) / 2e-5);
      }
      expect_near(gradient, expected, 2e-5);
    }
  }
}

TEST_P(EachField, SplittingLeavesTheFieldAsItIs) {
  for (const float beta : {0.0f, 4.0f}) {
    const auto field = two_cells(GetParam(), beta);
    struct Sample {
      double x, y, z, density;
    };
    std::vector<Sample> samples;
    base::Random random(5);
    for (int n = 0; n < 2000; ++n) {
      const double x = random.uniform(-16, 112), y = random.uniform(8, 72);
      const double z = random.uniform(0, kThickness);
      samples.push_back({x, y, z, field->density(x, y, z)});
    }
    // Leaves of 64, 32 and 16 px lie beside each other, before and after the split ones.
    for (const int leaf : {1, 0, 2, 7}) {
      field->edit({.split = {leaf}, .merge = {}});
      for (const Sample& s : samples) ASSERT_NEAR(field->density(s.x, s.y, s.z), s.density, 3e-6);
    }
    EXPECT_EQ(field->tree().num_leaves(), 14);
    EXPECT_EQ(field->shape(0), kFine);
    EXPECT_EQ(field->shape(13), kCoarse);
  }
}

TEST_P(EachField, InitialDensitiesAreThoseOfTheBias) {
  const auto field = two_cells(GetParam(), 4.0f);
  field->initialise(base::Random(9), 0.01);
  const double expected = std::log1p(std::exp(4.0 * 0.25)) / 4.0;
  EXPECT_NEAR(field->density(3, 33, 17), expected, 0.011);
  EXPECT_NE(field->density(3, 33, 17), expected);
}

TEST_P(EachField, InitialParametersDependOnNeitherThreadsNorTheLeavesThatAreKept) {
  const auto initial = [&](int threads, const std::vector<int>& kept) {
    base::set_thread_count(threads);
    auto field = two_cells(GetParam(), 4.0f);
    std::ranges::fill(field->parameters(), 0.0f);
    field->keep_only(kept);
    field->initialise(base::Random(9), 0.01);
    base::set_thread_count(0);
    return field;
  };
  const auto all = initial(1, {});
  base::Random random(9);
  for (const float value : all->parameters())
    ASSERT_EQ(value, static_cast<float>(random.uniform(-0.01, 0.01)));
  const auto on_three = initial(3, {}), second = initial(3, {1});
  for (std::size_t i = 0; i < all->num_parameters(); ++i) {
    ASSERT_EQ(on_three->parameters()[i], all->parameters()[i]);
    ASSERT_EQ(second->parameters()[i], i < all->offset(1)   ? 0.0f
                                       : i < all->offset(2) ? all->parameters()[i]
                                                            : 0.0f);
  }
}

TEST(Field, HasTheKindThatItWasMadeWith) {
  const RootGrid roots{.x0 = 0, .y0 = 0, .cell_size = 16, .columns = 1, .rows = 1};
  const Quadtree tree(roots, std::vector{Region::kInterest});
  EXPECT_EQ(make_field(FieldKind::kVm, tree, 8.0, {kFine})->kind(), FieldKind::kVm);
  EXPECT_EQ(make_field(FieldKind::kGrid, tree, 8.0, {kFine})->kind(), FieldKind::kGrid);
}

TEST(ArrayVariation, IsZeroButForEpsilonOnAConstant) {
  const std::vector<float> values(2 * 3 * 4 * 5, 1.5f);
  std::vector<float> gradient(values.size());
  const double value = array_variation(values.data(), 2, 3, 4, 5,
                                       {.epsilon = 0.01f, .concavity = 0.0f}, 2.0, gradient.data());
  EXPECT_NEAR(value, 2.0 * 120 * 0.01, 1e-6);
  EXPECT_EQ(gradient, std::vector<float>(values.size()));
}

}  // namespace
}  // namespace tomofield::field
