#include "objective/boundary_consistency.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "central_difference.h"
#include "random_arrays.h"

namespace tomofield::objective {
namespace {

using field::LeafShape;
using field::Quadtree;
using field::Region;

constexpr double kThickness = 21.0;

// Two bands of two cells of 64 px; one cell is split twice, so that leaves of
// 64, 32 and 16 px meet in both directions.
Quadtree uneven_tree() {
  const field::RootGrid roots{.x0 = -32, .y0 = 16, .cell_size = 64, .columns = 2, .rows = 2};
  Quadtree tree(roots, {Region::kInterest, Region::kMargin, Region::kInterest, Region::kInterest});
  tree.split(0);
  tree.split(3);
  return tree;
}

std::unique_ptr<field::Field> uneven_field(FieldKind kind) {
  const Quadtree tree = uneven_tree();
  std::vector<LeafShape> shapes;
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf) {
    shapes.push_back({.nx = 3 + leaf % 2, .ny = 3, .nz = 4, .rank_x = 2, .rank_y = 1, .rank_z = 2});
  }
  auto field = make_field(kind, tree, kThickness, shapes);
  field->initialise(base::Random(3), 1.0);
  field->bias = 0.25f;
  field->activation = {4.0f};
  return field;
}

// Returns the leaves of a band, or of both.
std::vector<int> leaves_of(const Quadtree& tree, const std::vector<int>& bands = {0, 1}) {
  std::vector<int> leaves;
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf)
    if (std::ranges::count(bands, tree.band_of_leaf(leaf)) > 0) leaves.push_back(leaf);
  return leaves;
}

// Compares the faces with find_leaf() half a pixel to either side, for each pixel of a face.
TEST(SharedFaces, AreTheSidesBetweenNeighbours) {
  const Quadtree tree = uneven_tree();
  const auto faces = shared_faces(tree);
  for (const bool faces_x : {true, false}) {
    const auto leaf_at = [&](std::int64_t across, std::int64_t along, double shift) {
      const double a = static_cast<double>(across) + 0.5 + shift;
      const double b = static_cast<double>(along) + 0.75;
      return faces_x ? tree.find_leaf(a, b) : tree.find_leaf(b, a);
    };
    for (std::int64_t across = -48; across <= 160; ++across) {
      for (std::int64_t along = -48; along < 160; ++along) {
        const int low = leaf_at(across, along, -0.5), high = leaf_at(across, along, 0.5);
        const bool expected = low >= 0 && high >= 0 && low != high;
        const auto covers = [&](const Face& f) {
          return f.faces_x == faces_x && f.at == across && f.begin <= along && along < f.end;
        };
        const auto found = std::find_if(faces.begin(), faces.end(), covers);
        ASSERT_EQ(std::count_if(faces.begin(), faces.end(), covers), expected ? 1 : 0)
            << across << ", " << along;
        if (!expected) continue;
        ASSERT_EQ(found->low, low);
        ASSERT_EQ(found->high, high);
      }
    }
  }
}

class EachBoundaryField : public ::testing::TestWithParam<FieldKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, EachBoundaryField,
                         ::testing::Values(FieldKind::kVm, FieldKind::kGrid),
                         [](const auto& kind) { return base::name_of(kind.param); });

constexpr BoundaryOptions kOptions{.weight = 0.7, .spacing = 5.0, .epsilon = 0.02, .seed = 9};

// Adds the gradient of some leaves and returns the sum of their terms.
TermValue add_leaves(const BoundaryConsistency& boundary, std::int64_t step,
                     const std::vector<int>& leaves, std::vector<float>& gradient) {
  const auto pass = boundary.leaf_pass({.number = step, .views = {}, .models = {}}, leaves);
  for (std::int64_t i = 0; i < pass->num_readings(); ++i) pass->read(i);
  TermValue sum;
  for (std::size_t i = 0; i < leaves.size(); ++i) sum += pass->add_leaf(i, gradient.data());
  return sum;
}

struct Total {
  double value = 0.0, grad_bias = 0.0;
  std::vector<float> gradient;
};
Total evaluate(const field::Field& field, const BoundaryOptions& options, std::int64_t step) {
  const BoundaryConsistency boundary(field, leaves_of(field.tree()), options);
  Total total;
  total.gradient.resize(field.num_parameters());
  for (const int band : {1, 0}) {
    const std::vector<int> leaves = leaves_of(field.tree(), {band});
    const TermValue of_band = add_leaves(boundary, step, leaves, total.gradient);
    total.value += of_band.value;
    total.grad_bias += of_band.grad_bias;
  }
  return total;
}

// With dense points the mean over a face is the integral over it. A regular sum over the densities
// of both leaves must give the same.
TEST_P(EachBoundaryField, ValueIsEquation6) {
  const auto field = uneven_field(GetParam());
  BoundaryOptions options = kOptions;
  options.spacing = 0.25;
  double expected = 0.0;
  for (const Face& f : shared_faces(field->tree())) {
    double squares = 0.0;
    int count = 0;
    for (double along = static_cast<double>(f.begin) + 0.25; along < static_cast<double>(f.end);
         along += 0.5) {
      for (double z = 0.25; z < kThickness; z += 0.5, ++count) {
        const auto density = [&](int leaf) {
          const double at = static_cast<double>(f.at) + 0.5;
          const double x = f.faces_x ? at : along + 0.5, y = f.faces_x ? along + 0.5 : at;
          float value = 0.0f;
          field->point_densities(leaf, {{&x, 1}, {&y, 1}, {&z, 1}}, {&value, 1});
          return static_cast<double>(value);
        };
        squares += std::pow(density(f.low) - density(f.high), 2);
      }
    }
    const double area = static_cast<double>(f.end - f.begin) * kThickness;
    expected += 0.7 * area * (std::sqrt(squares / count + 0.02 * 0.02) - 0.02);
  }
  EXPECT_NEAR(evaluate(*field, options, 0).value, expected, 1e-3 * expected);
}

TEST_P(EachBoundaryField, GradientIsTheDerivative) {
  const auto field = uneven_field(GetParam());
  const Total at = evaluate(*field, kOptions, 3);
  const auto derivative = [&](float& parameter) {
    return testing::central_difference(parameter, 1.0f / 512,
                                       [&] { return evaluate(*field, kOptions, 3).value; });
  };
  EXPECT_NEAR(at.grad_bias, derivative(field->bias), 2e-3 * std::abs(at.grad_bias));
  double largest = 0.0;
  for (const float g : at.gradient) largest = std::max(largest, std::abs(static_cast<double>(g)));
  for (std::size_t i = 0; i < at.gradient.size(); i += 7) {
    ASSERT_NEAR(static_cast<double>(at.gradient[i]), derivative(field->parameters()[i]),
                2e-3 * largest)
        << i;
  }
}

TEST_P(EachBoundaryField, VanishesWithItsGradientWhereLeavesAgree) {
  const auto field = uneven_field(GetParam());
  field->initialise(base::Random(3), 0.0);
  const Total at = evaluate(*field, kOptions, 3);
  EXPECT_EQ(at.value, 0.0);
  EXPECT_EQ(at.grad_bias, 0.0);
  EXPECT_EQ(at.gradient, std::vector<float>(at.gradient.size()));
}

TEST_P(EachBoundaryField, PointsAreNewInEveryStepAndTheSameForAStep) {
  const auto field = uneven_field(GetParam());
  const Total first = evaluate(*field, kOptions, 0);
  EXPECT_EQ(first.gradient, evaluate(*field, kOptions, 0).gradient);
  const Total second = evaluate(*field, kOptions, 1);
  EXPECT_NE(first.value, second.value);
  EXPECT_NEAR(first.value, second.value, 0.1 * first.value);
}

TEST_P(EachBoundaryField, LeavesThatAreNotGivenAreLeftAlone) {
  const auto field = uneven_field(GetParam());
  std::vector<int> listed = leaves_of(field->tree());
  std::erase(listed, 2);
  const BoundaryConsistency boundary(*field, listed, kOptions);
  for (const int band : {0, 1}) {
    std::vector<int> leaves = leaves_of(field->tree(), {band});
    std::erase(leaves, 2);
    std::vector<float> own(field->num_parameters());
    add_leaves(boundary, 0, leaves, own);
    for (int leaf = 0; leaf < field->tree().num_leaves(); ++leaf) {
      const auto begin = own.begin() + static_cast<std::ptrdiff_t>(field->offset(leaf));
      const auto end = own.begin() + static_cast<std::ptrdiff_t>(field->offset(leaf + 1));
      const bool is_touched = std::any_of(begin, end, [](float g) { return g != 0.0f; });
      EXPECT_EQ(is_touched, std::ranges::count(leaves, leaf) > 0) << leaf;
    }
  }
}

}  // namespace
}  // namespace tomofield::objective
