#include "objective/fourier_prior.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "base/threads/parallel.h"
#include "random_arrays.h"

namespace tomofield::objective {
namespace {

using field::LeafShape;
using field::Region;

constexpr Rectangle kRoi{.x0 = 4, .y0 = 16, .x1 = 118, .y1 = 106};

// Makes a margin cell, and leaves of 64 and 32 px over the region.
std::unique_ptr<field::Field> uneven_field(FieldKind kind) {
  const field::RootGrid roots{.x0 = -64, .y0 = 16, .cell_size = 64, .columns = 3, .rows = 2};
  std::vector<Region> regions(6, Region::kInterest);
  regions[0] = regions[3] = Region::kMargin;
  field::Quadtree tree(roots, regions);
  tree.split(1);
  const std::vector<LeafShape> shapes(
      static_cast<std::size_t>(tree.num_leaves()),
      {.nx = 20, .ny = 17, .nz = 5, .rank_x = 2, .rank_y = 1, .rank_z = 2});
  auto field = make_field(kind, tree, 21.0, shapes);
  field->initialise(base::Random(3), 1.0);
  field->bias = 0.25f;
  field->activation = {4.0f};
  return field;
}

FourierPriorOptions some_options() {
  FourierPriorOptions options;
  options.weight = 0.5;
  options.max_samples = 40;
  options.seed = 4;
  return options;
}

class EachFourierField : public ::testing::TestWithParam<FieldKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, EachFourierField,
                         ::testing::Values(FieldKind::kVm, FieldKind::kGrid),
                         [](const auto& kind) { return base::name_of(kind.param); });

// Makes stripes along y: all vertices at one x have the same value.
void make_stripes(field::Field& field) {
  field.initialise(base::Random(3), 0.0);
  for (int leaf = 0; leaf < field.tree().num_leaves(); ++leaf) {
    const LeafShape& s = field.shape(leaf);
    float* p = field.parameters().data() + field.offset(leaf);
    const bool is_vm = field.kind() == FieldKind::kVm;
    const int a_vertex = is_vm ? s.rank_x : s.nz * s.ny;
    for (int x = 0; x < s.nx; ++x)
      std::fill_n(p + x * a_vertex, a_vertex, x % 3 == 0 ? 0.4f : 0.0f);
    if (is_vm) std::fill_n(p + s.nx * a_vertex, s.nz * s.ny * s.rank_x, 0.5f);
  }
}

// The axes of stripes stand out so far that the rings, which the gradient takes
// for constants, do not matter: the value falls by what the gradient promises.
TEST_P(EachFourierField, ValueFallsAsTheGradientPromises) {
  const auto field = uneven_field(GetParam());
  make_stripes(*field);
  const FourierPrior prior(*field, kRoi, some_options());
  std::vector<float> gradient(field->num_parameters());
  const auto first = prior.add_gradient(0, gradient.data());
  ASSERT_GT(first.value, 0.0);
  double squares = first.grad_bias * first.grad_bias;
  for (const float g : gradient) squares += static_cast<double>(g) * static_cast<double>(g);
  // Takes a small step along the gradient, which changes the value by a hundredth.
  const double step = 0.01 * first.value / squares;
  for (std::size_t i = 0; i < gradient.size(); ++i)
    field->parameters()[i] -= static_cast<float>(step * static_cast<double>(gradient[i]));
  field->bias -= static_cast<float>(step * first.grad_bias);
  std::vector<float> unused(gradient.size());
  const double after = prior.add_gradient(0, unused.data()).value;
  EXPECT_LT(after, first.value);
  EXPECT_NEAR((first.value - after) / first.value, 0.01, 0.001);
}

TEST_P(EachFourierField, IsTheSameForAnyThreadsAndNewInEveryStep) {
  const auto field = uneven_field(GetParam());
  const FourierPrior prior(*field, kRoi, some_options());
  EXPECT_EQ(prior.shape().nx, 40);
  EXPECT_EQ(prior.shape().ny, 31);  // 90 px at 2.85 px
  const auto run = [&](int threads, std::int64_t step) {
    base::set_thread_count(threads);
    std::vector<float> gradient(field->num_parameters());
    prior.add_gradient(step, gradient.data());
    base::set_thread_count(1);
    return gradient;
  };
  const auto expected = run(1, 7);
  EXPECT_EQ(run(3, 7), expected);
  EXPECT_NE(run(1, 8), expected);
}

TEST_P(EachFourierField, LeavesTheMarginAlone) {
  const auto field = uneven_field(GetParam());
  const FourierPrior prior(*field, kRoi, some_options());
  std::vector<float> gradient(field->num_parameters());
  for (std::int64_t step = 0; step < 3; ++step) prior.add_gradient(step, gradient.data());
  for (int leaf = 0; leaf < field->tree().num_leaves(); ++leaf) {
    double largest = 0.0;
    for (std::size_t i = field->offset(leaf); i < field->offset(leaf + 1); ++i)
      largest = std::max(largest, std::abs(static_cast<double>(gradient[i])));
    EXPECT_EQ(largest > 0.0, field->tree().leaf(leaf).region == Region::kInterest) << leaf;
  }
}

}  // namespace
}  // namespace tomofield::objective
