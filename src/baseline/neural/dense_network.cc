#include "baseline/neural/dense_network.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/random.h"
#include "kernels/small_gemm.h"

namespace tomofield::baseline {

DenseNetwork::DenseNetwork(std::vector<int> widths, Activation activation)
    : activation_(activation) {
  widths.push_back(1);
  std::size_t offset = 0;
  for (std::size_t i = 0; i + 1 < widths.size(); ++i) {
    layers_.push_back({widths[i], widths[i + 1], offset});
    offset += layers_.back().num_weights() + static_cast<std::size_t>(widths[i + 1]);
  }
}

std::size_t DenseNetwork::num_parameters() const {
  const Layer& last = layers_.back();
  return last.offset + last.num_weights() + static_cast<std::size_t>(last.outputs);
}

std::size_t DenseNetwork::values_per_point() const {
  int values = 0, widest = 0;
  for (const Layer& layer : layers_) {
    values += 2 * layer.inputs;  // values and slopes
    widest = std::max(widest, layer.inputs);
  }
  return static_cast<std::size_t>(values + 2 * widest);
}

void DenseNetwork::initialize(std::uint64_t seed, std::span<float> parameters) const {
  base::Random random(seed);
  for (const Layer& layer : layers_) {
    const double part = &layer == &layers_.back() ? 0.1 : 1.0;
    const double reach = part * std::sqrt(6.0 / layer.inputs);
    const std::span<float> own = parameters.subspan(layer.offset);
    for (float& weight : own.first(layer.num_weights()))
      weight = static_cast<float>(random.uniform(-reach, reach));
    std::fill_n(own.data() + layer.num_weights(), layer.outputs, 0.0f);
  }
}

float* DenseNetwork::inputs(int num_points, Batch& batch) const {
  batch.values.resize(layers_.size() + 1);
  batch.slopes.resize(layers_.size());
  batch.values.front().resize(static_cast<std::size_t>(num_points) *
                              static_cast<std::size_t>(num_inputs()));
  return batch.values.front().data();
}

std::span<float> DenseNetwork::forward(std::span<const float> parameters, int num_points,
                                       Batch& batch) const {
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    const auto [inputs, outputs, offset] = layers_[i];
    const float* weights = parameters.data() + offset;
    const float* biases = weights + layers_[i].num_weights();
    std::vector<float>& values = batch.values[i + 1];
    values.resize(static_cast<std::size_t>(num_points) * static_cast<std::size_t>(outputs));
    for (auto at = values.begin(); at != values.end(); at += outputs)
      std::copy_n(biases, outputs, at);
    kernels::small_gemm({.rows = num_points,
                         .depth = inputs,
                         .width = outputs,
                         .a = batch.values[i].data(),
                         .a_row = inputs,
                         .a_col = 1,
                         .b = weights,
                         .b_row = outputs,
                         .c = values.data(),
                         .c_row = outputs});
    if (i + 1 == layers_.size()) break;
    activate(values, batch.slopes[i]);
  }
  return batch.values.back();
}

void DenseNetwork::activate(std::vector<float>& values, std::vector<float>& slopes) const {
  slopes.resize(values.size());
  if (activation_ == Activation::kRectifier) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      slopes[i] = values[i] > 0 ? 1.0f : 0.0f;
      values[i] = std::max(values[i], 0.0f);
    }
    return;
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float cycles = values[i] * (0.5f / std::numbers::pi_v<float>);
    slopes[i] = sine_of_cycles(cycles + 0.25f);
    values[i] = sine_of_cycles(cycles);
  }
}

std::span<const float> DenseNetwork::backward(std::span<const float> parameters,
                                              std::span<const float> grad_outputs, Batch& batch,
                                              std::span<float> grad_parameters) const {
  batch.gradient.assign(grad_outputs.begin(), grad_outputs.end());
  for (std::size_t i = layers_.size(); i-- > 0;) {
    if (i + 1 < layers_.size()) {
      const std::vector<float>& slopes = batch.slopes[i];
      for (std::size_t n = 0; n < slopes.size(); ++n) batch.gradient[n] *= slopes[n];
    }
    backward_layer(i, parameters, batch, grad_parameters);
    batch.gradient.swap(batch.next_gradient);
  }
  return batch.gradient;
}

// Turns batch.gradient, by a layer's sums, into batch.next_gradient, by its inputs.
void DenseNetwork::backward_layer(std::size_t index, std::span<const float> parameters,
                                  Batch& batch, std::span<float> grad_parameters) const {
  const auto [inputs, outputs, offset] = layers_[index];
  const std::size_t num_weights = layers_[index].num_weights();
  const float *weights = parameters.data() + offset, *sums = batch.gradient.data();
  const std::ptrdiff_t num_points = std::ssize(batch.gradient) / outputs;
  float* grad_weights = grad_parameters.data() + offset;
  kernels::small_gemm({.rows = inputs,
                       .depth = num_points,
                       .width = outputs,
                       .a = batch.values[index].data(),
                       .a_row = 1,
                       .a_col = inputs,
                       .b = sums,
                       .b_row = outputs,
                       .c = grad_weights,
                       .c_row = outputs});
  float* grad_biases = grad_weights + num_weights;
  for (std::ptrdiff_t p = 0; p < num_points; ++p)
    for (int o = 0; o < outputs; ++o) grad_biases[o] += sums[p * outputs + o];

  batch.transposed.resize(num_weights);
  for (int i = 0; i < inputs; ++i)
    for (int o = 0; o < outputs; ++o)
      batch.transposed[static_cast<std::size_t>(o * inputs + i)] = weights[i * outputs + o];
  batch.next_gradient.assign(static_cast<std::size_t>(num_points * inputs), 0.0f);
  kernels::small_gemm({.rows = num_points,
                       .depth = outputs,
                       .width = inputs,
                       .a = sums,
                       .a_row = outputs,
                       .a_col = 1,
                       .b = batch.transposed.data(),
                       .b_row = inputs,
                       .c = batch.next_gradient.data(),
                       .c_row = inputs});
}

}  // namespace tomofield::baseline
