#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tomofield::baseline {

/// What a hidden layer makes of its affine sums. Sines (Sitzmann et al. 2020) are zero on
/// average, so that no weight moves all outputs at once.
enum class Activation { kRectifier, kSine };

/// A small multilayer perceptron: affine layers, an activation between them, one output. It holds
/// no parameters; every call is given them: [layer][weights [input, output], biases [output]].
class DenseNetwork {
 public:
  /// `widths`: number of inputs, then of neurons in each hidden layer.
  DenseNetwork(std::vector<int> widths, Activation activation);

  int num_inputs() const { return layers_.front().inputs; }
  std::size_t num_parameters() const;
  /// Floats that a batch holds a point, about.
  std::size_t values_per_point() const;
  /// Weights uniform in ± √(6 / inputs) (He et al. 2015), those of the last layer a tenth of it so
  /// that outputs start near zero; biases zero.
  void initialize(std::uint64_t seed, std::span<float> parameters) const;

  /// A thread's buffers for a batch of points, kept between calls.
  struct Batch {
    std::vector<std::vector<float>> values;  ///< [layer][point, width], from the inputs on
    std::vector<std::vector<float>> slopes;  ///< of the activations, [hidden layer][point, width]
    std::vector<float> gradient, next_gradient, transposed;
  };
  /// Makes room for the points and returns where their inputs go, [point, input].
  float* inputs(int num_points, Batch& batch) const;
  /// From the inputs to the outputs, one a point, which are returned.
  std::span<float> forward(std::span<const float> parameters, int num_points, Batch& batch) const;
  /// After forward(): adds the gradient of Σ grad_outputs · outputs to grad_parameters, and
  /// returns that by the inputs, [point, input].
  std::span<const float> backward(std::span<const float> parameters,
                                  std::span<const float> grad_outputs, Batch& batch,
                                  std::span<float> grad_parameters) const;

 private:
  struct Layer {
    int inputs, outputs;
    std::size_t offset;  ///< of its parameters
    std::size_t num_weights() const {
      return static_cast<std::size_t>(inputs) * static_cast<std::size_t>(outputs);
    }
  };
  void activate(std::vector<float>& values, std::vector<float>& slopes) const;
  void backward_layer(std::size_t index, std::span<const float> parameters, Batch& batch,
                      std::span<float> grad_parameters) const;

  std::vector<Layer> layers_;
  Activation activation_;
};

}  // namespace tomofield::baseline
