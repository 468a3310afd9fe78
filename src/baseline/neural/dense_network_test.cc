#include "baseline/neural/dense_network.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "central_difference.h"
#include "random_arrays.h"

namespace tomofield::baseline {
namespace {

constexpr int kNumPoints = 7;

// Computes a network's output in the plainest way, in double.
double evaluate(const std::vector<int>& widths, Activation activation,
                const std::vector<float>& parameters, const float* inputs) {
  std::vector<double> values(inputs, inputs + widths[0]);
  const float* p = parameters.data();
  for (std::size_t layer = 0; layer < widths.size(); ++layer) {
    const bool is_last = layer + 1 == widths.size();
    const int outputs = is_last ? 1 : widths[layer + 1];
    std::vector<double> sums(p + widths[layer] * outputs, p + (widths[layer] + 1) * outputs);
    for (std::size_t i = 0; i < values.size(); ++i)
      for (double& sum : sums) sum += values[i] * static_cast<double>(*p++);
    p += outputs;
    if (!is_last)
      for (double& sum : sums)
        sum = activation == Activation::kSine ? std::sin(sum) : std::max(sum, 0.0);
    values = sums;
  }
  return values.front();
}

class DenseNetworks : public ::testing::TestWithParam<Activation> {};

TEST_P(DenseNetworks, AreLayersWithActivationsBetween) {
  const std::vector<int> widths = {5, 18, 3};
  const DenseNetwork network(widths, GetParam());
  ASSERT_EQ(network.num_parameters(), 6u * 18 + 19 * 3 + 4);
  const auto parameters = testing::random_floats(network.num_parameters(), 1);
  const auto inputs = testing::random_floats(kNumPoints * 5, 2);
  DenseNetwork::Batch batch;
  std::ranges::copy(inputs, network.inputs(kNumPoints, batch));
  const std::span<const float> outputs = network.forward(parameters, kNumPoints, batch);
  ASSERT_EQ(outputs.size(), static_cast<std::size_t>(kNumPoints));
  for (int n = 0; n < kNumPoints; ++n)
    EXPECT_NEAR(outputs[static_cast<std::size_t>(n)],
                evaluate(widths, GetParam(), parameters, &inputs[5 * n]), 1e-5);
}

TEST_P(DenseNetworks, HaveGradientsThatAreThoseOfFiniteDifferences) {
  const DenseNetwork network({4, 9, 6}, GetParam());
  auto parameters = testing::random_floats(network.num_parameters(), 3);
  auto inputs = testing::random_floats(kNumPoints * 4, 4);
  const auto weights = testing::random_floats(kNumPoints, 5);
  DenseNetwork::Batch batch;
  const auto objective = [&] {
    std::ranges::copy(inputs, network.inputs(kNumPoints, batch));
    const std::span<const float> outputs = network.forward(parameters, kNumPoints, batch);
    return testing::dot({outputs.begin(), outputs.end()}, weights);
  };
  objective();
  std::vector<float> gradient(parameters.size());
  const std::span<const float> by_inputs = network.backward(parameters, weights, batch, gradient);
  const std::vector<float> by_input(by_inputs.begin(), by_inputs.end());
  for (std::size_t i = 0; i < gradient.size(); ++i)
    EXPECT_NEAR(gradient[i], testing::central_difference(parameters[i], 1e-3f, objective), 2e-2)
        << "parameter " << i;
  for (std::size_t i = 0; i < inputs.size(); ++i)
    EXPECT_NEAR(by_input[i], testing::central_difference(inputs[i], 1e-3f, objective), 2e-2)
        << "input " << i;
}

TEST_P(DenseNetworks, StartNearZeroButNotAtIt) {
  const DenseNetwork network({32, 64, 64, 64}, GetParam());
  std::vector<float> parameters(network.num_parameters());
  network.initialize(1, parameters);
  DenseNetwork::Batch batch;
  const auto inputs = testing::random_floats(32 * 500, 6);
  std::ranges::copy(inputs, network.inputs(500, batch));
  double squares = 0;
  for (const float output : network.forward(parameters, 500, batch))
    squares += static_cast<double>(output) * static_cast<double>(output);
  const double size = std::sqrt(squares / 500);
  EXPECT_GT(size, 0.01);
  EXPECT_LT(size, 0.3);
}

INSTANTIATE_TEST_SUITE_P(Activations, DenseNetworks,
                         ::testing::Values(Activation::kRectifier, Activation::kSine));

}  // namespace
}  // namespace tomofield::baseline
