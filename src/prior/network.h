#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/aligned_buffer.h"
#include "kernels/convolution.h"

namespace tomofield::prior {

/// Numbers of vertices of a box along x, z and y, in which the vertices of leaves are laid out: y
/// runs fastest.
struct BoxShape {
  int nx = 0, nz = 0, ny = 0;
  std::size_t size() const {
    return static_cast<std::size_t>(nx) * static_cast<std::size_t>(nz) *
           static_cast<std::size_t>(ny);
  }
  bool operator==(const BoxShape&) const = default;
};

/// A small convolutional network that returns what a box of noisy densities probably shows: a U-Net
/// (Ronneberger, Fischer and Brox 2015) of three levels with 8, 16 and 32 channels, 3 × 3 × 3
/// filters and leaky rectifiers, whose output is added to its input. It has no biases, so that
/// multiplying the densities by a positive number multiplies the answer (Mohan et al. 2020): it
/// needs neither the unit of the densities nor the level of their noise.
class Network {
 public:
  /// Channels of the input: the densities of the fit, and those of a fit with less smoothing.
  static constexpr int kInputs = 2;
  /// Distance in vertices, along each axis, of the farthest inputs that an output depends on.
  static constexpr int kReach = 24;
  /// The sides of a box are multiples of this.
  static constexpr int kSideUnit = 4;

  /// Takes the filters of all convolutions in the order in which they are applied, each
  /// [output, input, tap x, tap z, tap y], and then the weights of the last channels in the output.
  /// There must be num_weights() of them.
  explicit Network(std::span<const float> weights);
  static std::size_t num_weights();
  /// Returns the number of weights of each filter, in the same order; the last ones count as one.
  static std::vector<std::size_t> filter_sizes();
  /// Returns the network with the weights that tools/train_prior made (weights.h).
  static const Network& trained();

  /// Returns about the bytes that apply() takes for a box.
  static std::size_t memory(const BoxShape& shape);

  /// Replaces `smooth` by the answer. Both arrays are [x, z, y]; beyond them lie zeros. Works on
  /// all threads; their number changes no bit.
  void apply(const BoxShape& shape, std::span<float> smooth, std::span<const float> light) const;

 private:
  struct Layer {
    int num_in, num_out;
    base::AlignedBuffer<float> weights;  // as kernels::Convolution orders them
  };
  class Channels;
  void convolve(const Layer& layer, const Channels& in, Channels& out) const;
  // Convolves the channels of a level together with those of the next coarser one, of which each
  // voxel stands for 2 × 2 × 2.
  void convolve_joined(const Layer& layer, const Channels& fine, const Channels& coarse,
                       Channels& out) const;

  std::vector<Layer> layers_;
  std::vector<float> last_;  // weight of each of the last channels in the output
};

}  // namespace tomofield::prior
