#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

namespace tomofield::baseline {

/// Returns sin(2π cycles) to 4·10⁻⁶, for |cycles| up to a few thousand, where the rounding of the
/// argument adds as much. It has no branches, so compilers vectorise a loop over it. It removes
/// whole cycles, folds the rest to a quarter, and sums Taylor's series up to the ninth power.
inline float sine_of_cycles(float cycles) {
  constexpr float kRounds = 12582912.0f;  // 1.5 · 2²³: adding it rounds to an integer
  const float part = cycles - ((cycles + kRounds) - kRounds);
  const float quarter = 0.25f - std::abs(std::abs(part) - 0.25f);
  const float a = 2 * std::numbers::pi_v<float> * quarter, s = a * a;
  const float series =
      1 + s * (-1.0f / 6 + s * (1.0f / 120 + s * (-1.0f / 5040 + s * (1.0f / 362880))));
  return std::copysign(a * series, part);
}

/// The activation of the hidden layers. Sines (Sitzmann et al. 2020) are zero on average, so no
/// weight moves all outputs at once.
enum class Activation { kRectifier, kSine };

/// A small multilayer perceptron: affine layers with an activation between them and one output. It
/// holds no parameters. Every call receives them as
///   [layer][weights [input, output], biases [output]].
class DenseNetwork {
 public:
  /// Makes a network. `widths` is the number of inputs, then that of the neurons in each hidden
  /// layer.
  DenseNetwork(std::vector<int> widths, Activation activation);

  int num_inputs() const { return layers_.front().inputs; }
  std::size_t num_parameters() const;
  /// Returns about how many floats a batch holds a point.
  std::size_t values_per_point() const;
  /// Sets the weights to uniform random numbers in ± √(6 / inputs) (He et al. 2015) and the biases
  /// to zero. Weights of the last layer are a tenth of that, so that outputs start near zero.
  void initialize(std::uint64_t seed, std::span<float> parameters) const;

  /// The buffers of a thread for a batch of points, kept between calls.
  struct Batch {
    std::vector<std::vector<float>> values;  ///< [layer][point, width], from the inputs on
    std::vector<std::vector<float>> slopes;  ///< activations' slopes [hidden layer][point, width]
    std::vector<float> gradient, next_gradient, transposed;
  };
  /// Makes room for the points. Returns the place of their inputs, [point, input].
  float* inputs(int num_points, Batch& batch) const;
  /// Computes the outputs from the inputs and returns them, one a point.
  std::span<float> forward(std::span<const float> parameters, int num_points, Batch& batch) const;
  /// Adds the gradient of Σ grad_outputs · outputs to grad_parameters. Returns the gradient by the
  /// inputs, [point, input]. Call forward() first.
  std::span<const float> backward(std::span<const float> parameters,
                                  std::span<const float> grad_outputs, Batch& batch,
                                  std::span<float> grad_parameters) const;

 private:
  struct Layer {
    int inputs, outputs;
    std::size_t offset;  ///< index of its first parameter
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
