#include "fit/adam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "random_arrays.h"

namespace tomofield::fit {
namespace {

// Makes a field of six leaves of different sizes.
std::unique_ptr<field::Field> small_field() {
  const field::RootGrid roots{.x0 = 0, .y0 = 0, .cell_size = 16, .columns = 3, .rows = 2};
  field::Quadtree tree(roots, std::vector<field::Region>(6, field::Region::kInterest));
  std::vector<field::LeafShape> shapes;
  for (int i = 0; i < 6; ++i) shapes.push_back({.nx = 2 + i, .ny = 3, .nz = 2});
  auto field = field::make_field(FieldKind::kGrid, std::move(tree), 8.0, std::move(shapes));
  field->initialise(base::Random(1), 0.5);
  return field;
}

// Adam for one parameter as Kingma and Ba write it, in doubles.
struct PlainAdam {
  double m = 0, v = 0;
  int t = 0;
  double step(double p, double g, double rate) {
    ++t;
    m = 0.9 * m + 0.1 * g;
    v = 0.99 * v + 0.01 * g * g;
    return p - rate * (m / (1 - std::pow(0.9, t))) / std::sqrt(v / (1 - std::pow(0.99, t)));
  }
};

// Runs `num_steps` steps on varying leaves and compares every parameter.
void compare_with_plain_adam(const std::vector<std::vector<int>>& leaves_of_step) {
  const auto field = small_field();
  Adam adam(*field, {});
  base::AlignedBuffer<float> gradient(field->num_parameters());
  std::vector<PlainAdam> plain(field->num_parameters());
  std::vector<double> expected(field->parameters().begin(), field->parameters().end());
  for (std::size_t t = 0; t < leaves_of_step.size(); ++t) {
    const double rate = 0.05 * std::pow(0.9, static_cast<double>(t));
    const auto g = testing::random_floats(field->num_parameters(), 100 + t);
    for (const int leaf : leaves_of_step[t]) {
      for (std::size_t i = field->offset(leaf); i < field->offset(leaf + 1); ++i) {
        gradient[i] = g[i];
        expected[i] = plain[i].step(expected[i], static_cast<double>(g[i]), rate);
      }
    }
    for (const int leaf : leaves_of_step[t]) adam.step(*field, leaf, gradient, rate);
    for (const float left : gradient) ASSERT_EQ(left, 0.0f) << "the gradient is used up";
  }
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_NEAR(field->parameters()[i], expected[i], 2e-6) << "parameter " << i;
}

TEST(FieldAdam, IsAdamOnEveryParameter) {
  compare_with_plain_adam(std::vector<std::vector<int>>(25, {0, 1, 2, 3, 4, 5}));
}

TEST(FieldAdam, MomentsAdvanceOnlyWhenALeafIsTouched) {
  std::vector<std::vector<int>> leaves;
  for (int t = 0; t < 30; ++t) {
    leaves.push_back({5});
    if (t % 3 == 0) leaves.back().push_back(1);
    if (t > 20) leaves.back().push_back(2);
  }
  compare_with_plain_adam(leaves);  // leaves 0, 3 and 4 never move
}

TEST(FieldAdam, CountsTheStepsOfEachLeaf) {
  const auto field = small_field();
  Adam adam(*field, {});
  base::AlignedBuffer<float> gradient(field->num_parameters());
  for (const int leaf : {0, 2}) adam.step(*field, leaf, gradient, 0.1);
  for (const int leaf : {2, 3}) adam.step(*field, leaf, gradient, 0.1);
  EXPECT_EQ(adam.state().leaf_steps, (std::vector<std::int64_t>{1, 0, 2, 1, 0, 0}));
}

TEST(FieldAdam, ZeroGradientMovesNothing) {
  const auto field = small_field();
  const std::vector<float> before(field->parameters().begin(), field->parameters().end());
  Adam adam(*field, {});
  base::AlignedBuffer<float> gradient(field->num_parameters());
  for (const int leaf : {0, 1, 2, 3, 4, 5}) adam.step(*field, leaf, gradient, 0.1);
  adam.step_bias(*field, 0.0, 0.1);
  EXPECT_TRUE(std::equal(before.begin(), before.end(), field->parameters().begin()));
  EXPECT_EQ(field->bias, 0.0f);
}

TEST(FieldAdam, BiasFollowsTheSameRule) {
  const auto field = small_field();
  Adam adam(*field, {});
  PlainAdam plain;
  double expected = field->bias;
  base::Random random(4);
  for (int t = 0; t < 40; ++t) {
    const double g = random.uniform(-1, 3);
    adam.step_bias(*field, g, 0.01);
    expected = plain.step(expected, g, 0.01);
  }
  EXPECT_NEAR(field->bias, expected, 1e-6);
  EXPECT_EQ(adam.state().bias_steps, 40);
}

// A checkpoint stores the state. A new optimiser with this state takes the same steps.
TEST(FieldAdam, GoesOnFromItsStateToTheSameBits) {
  const auto run = [](bool stop_halfway) {
    const auto field = small_field();
    auto adam = std::make_unique<Adam>(*field, AdamOptions{});
    base::AlignedBuffer<float> gradient(field->num_parameters());
    for (std::size_t t = 0; t < 10; ++t) {
      if (stop_halfway && t == 5) {
        auto resumed = std::make_unique<Adam>(*field, AdamOptions{});
        resumed->state() = std::move(adam->state());
        adam = std::move(resumed);
      }
      const auto g = testing::random_floats(field->num_parameters(), t);
      std::copy(g.begin(), g.end(), gradient.begin());
      for (const int leaf : {0, 1, 2, 3, 4, 5}) adam->step(*field, leaf, gradient, 0.05);
      adam->step_bias(*field, static_cast<double>(g[0]), 0.01);
    }
    std::vector<float> result(field->parameters().begin(), field->parameters().end());
    result.push_back(field->bias);
    return result;
  };
  EXPECT_EQ(run(false), run(true));
}

}  // namespace
}  // namespace tomofield::fit
