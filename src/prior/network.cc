#include "prior/network.h"

#include <algorithm>
#include <array>

#include "base/check.h"
#include "base/threads/parallel.h"
#include "prior/weights.h"

namespace tomofield::prior {
namespace {

using kernels::ChannelShape;

constexpr int kTaps = 27;
constexpr float kSlope = 0.1f;  // of the leaky rectifiers

struct LayerShape {
  int num_in, num_out;
};
// The convolutions in the order in which they are applied: two on each level on the way down and
// two on each level on the way up.
constexpr std::array<LayerShape, 10> kLayers{{{Network::kInputs, 8},
                                              {8, 8},
                                              {8, 16},
                                              {16, 16},
                                              {16, 32},
                                              {32, 32},
                                              {48, 16},
                                              {16, 16},
                                              {24, 8},
                                              {8, 8}}};
// The channels that the output is a weighted sum of.
constexpr int kLastChannels = 8;

ChannelShape channel_shape(const BoxShape& box, int level) {
  return {box.ny >> level, box.nz >> level, box.nx >> level};
}

// Returns the filters of a layer in the order of the kernel.
base::AlignedBuffer<float> kernel_order(const LayerShape& layer, std::span<const float> filters) {
  constexpr int kTogether = kernels::kOutputsTogether;
  base::AlignedBuffer<float> ordered(filters.size());
  std::size_t next = 0;
  for (int o = 0; o < layer.num_out; ++o)
    for (int i = 0; i < layer.num_in; ++i)
      for (int tap = 0; tap < kTaps; ++tap)
        ordered[static_cast<std::size_t>(
            ((o / kTogether * layer.num_in + i) * kTaps + tap) * kTogether + o % kTogether)] =
            filters[next++];
  return ordered;
}

}  // namespace

// Channels of one level, with borders of zeros.
class Network::Channels {
 public:
  Channels(const ChannelShape& shape, int num_channels)
      : shape_(shape),
        num_channels_(num_channels),
        data_(static_cast<std::size_t>(num_channels * shape.stride_channel()) + kPastTheEnd) {}

  const ChannelShape& shape() const { return shape_; }
  int num_channels() const { return num_channels_; }
  // Sets a plane of all channels to zero.
  void clear_plane(int z) {
    for (int c = 0; c < num_channels_; ++c)
      std::fill_n(channel(c) + (z + 1) * shape_.stride_z(), shape_.stride_z(), 0.0f);
  }
  float* channel(int index) { return data_.data() + index * shape_.stride_channel(); }
  const float* channel(int index) const { return data_.data() + index * shape_.stride_channel(); }
  float* row(int channel, int y, int z) { return this->channel(channel) + shape_.at(0, y, z); }
  const float* row(int channel, int y, int z) const {
    return this->channel(channel) + shape_.at(0, y, z);
  }

 private:
  static constexpr std::size_t kPastTheEnd = 16;  // the last vector of the last row reads them
  ChannelShape shape_;
  int num_channels_;
  base::AlignedBuffer<float> data_;
};

namespace {

// Copies a box into a channel.
template <class Channels>
void fill_channel(std::span<const float> box, int channel, Channels& channels) {
  const ChannelShape& s = channels.shape();
  for (int z = 0; z < s.nz; ++z)
    for (int y = 0; y < s.ny; ++y)
      std::copy_n(box.data() + (static_cast<std::ptrdiff_t>(z) * s.ny + y) * s.nx, s.nx,
                  channels.row(channel, y, z));
}

// Writes the means of blocks of 2 × 2 × 2 voxels.
template <class Channels>
void halve(const Channels& fine, Channels& coarse) {
  const ChannelShape& s = coarse.shape();
  base::parallel_for("halve channels", s.nz, [&](std::int64_t plane) {
    const int z = static_cast<int>(plane);
    for (int c = 0; c < coarse.num_channels(); ++c) {
      for (int y = 0; y < s.ny; ++y) {
        const float *a = fine.row(c, 2 * y, 2 * z), *b = fine.row(c, 2 * y + 1, 2 * z),
                    *d = fine.row(c, 2 * y, 2 * z + 1), *e = fine.row(c, 2 * y + 1, 2 * z + 1);
        float* const out = coarse.row(c, y, z);
        for (int x = 0; x < s.nx; ++x) {
          const int f = 2 * x;
          out[x] = 0.125f * (a[f] + a[f + 1] + b[f] + b[f + 1] + d[f] + d[f + 1] + e[f] + e[f + 1]);
        }
      }
    }
  });
}

// Writes a plane of channels into a plane of others.
template <class Channels>
void copy_plane(const Channels& from, int z, Channels& to, int to_z) {
  const ChannelShape& s = to.shape();
  for (int c = 0; c < from.num_channels(); ++c)
    for (int y = 0; y < s.ny; ++y) std::copy_n(from.row(c, y, z), s.nx, to.row(c, y, to_z));
}

// Writes each voxel of a plane of `coarse` into 2 × 2 of a plane of `fine`, from channel `first`
// on.
template <class Channels>
void repeat_plane(const Channels& coarse, int z, int first, Channels& fine, int to_z) {
  const ChannelShape& s = fine.shape();
  for (int c = 0; c < coarse.num_channels(); ++c) {
    for (int y = 0; y < s.ny; ++y) {
      const float* const in = coarse.row(c, y / 2, z);
      float* const out = fine.row(first + c, y, to_z);
      for (int x = 0; x < s.nx; ++x) out[x] = in[x / 2];
    }
  }
}

}  // namespace

Network::Network(std::span<const float> weights) {
  TOMOFIELD_CHECK(weights.size() == num_weights(), "the weights of all layers");
  for (const LayerShape& layer : kLayers) {
    const auto count = static_cast<std::size_t>(layer.num_in * layer.num_out * kTaps);
    layers_.push_back({layer.num_in, layer.num_out, kernel_order(layer, weights.first(count))});
    weights = weights.subspan(count);
  }
  last_.assign(weights.begin(), weights.end());
}

std::size_t Network::num_weights() {
  std::size_t count = kLastChannels;
  for (const LayerShape& layer : kLayers)
    count += static_cast<std::size_t>(layer.num_in * layer.num_out * kTaps);
  return count;
}

std::vector<std::size_t> Network::filter_sizes() {
  std::vector<std::size_t> sizes;
  for (const LayerShape& layer : kLayers)
    sizes.insert(sizes.end(), static_cast<std::size_t>(layer.num_out),
                 static_cast<std::size_t>(layer.num_in * kTaps));
  sizes.push_back(kLastChannels);
  return sizes;
}

const Network& Network::trained() {
  static const Network network{trained_weights()};
  return network;
}

void Network::convolve(const Layer& layer, const Channels& in, Channels& out) const {
  const kernels::Convolution convolution{layer.num_in, layer.num_out, kSlope, layer.weights.data()};
  base::parallel_for("convolve", in.shape().nz, [&](std::int64_t plane) {
    const int z = static_cast<int>(plane);
    kernels::convolve(in.shape(), convolution, {z, z + 1}, in.channel(0), out.channel(0));
  });
}

// A whole input of both would take twice the memory of everything else. Every thread lays out the
// three planes that a plane of the output depends on.
void Network::convolve_joined(const Layer& layer, const Channels& fine, const Channels& coarse,
                              Channels& out) const {
  const ChannelShape& shape = fine.shape();
  const ChannelShape plane{shape.nx, shape.ny, 1};
  std::vector<Channels> inputs, outputs;  // of each thread
  for (int thread = 0; thread < base::thread_count(); ++thread) {
    inputs.emplace_back(plane, layer.num_in);
    outputs.emplace_back(plane, layer.num_out);
  }
  const kernels::Convolution convolution{layer.num_in, layer.num_out, kSlope, layer.weights.data()};
  base::parallel_for("convolve", shape.nz, [&](std::int64_t i) {
    const int z = static_cast<int>(i);
    const auto thread = static_cast<std::size_t>(base::thread_index());
    Channels& in = inputs[thread];
    for (int step = -1; step <= 1; ++step) {
      if (z + step < 0 || z + step >= shape.nz) {
        in.clear_plane(step);
        continue;
      }
      copy_plane(fine, z + step, in, step);
      repeat_plane(coarse, (z + step) / 2, fine.num_channels(), in, step);
    }
    kernels::convolve(plane, convolution, {0, 1}, in.channel(0), outputs[thread].channel(0));
    copy_plane(outputs[thread], 0, out, z);
  });
}

void Network::apply(const BoxShape& box, std::span<float> smooth,
                    std::span<const float> light) const {
  TOMOFIELD_CHECK(box.nx % kSideUnit == 0 && box.ny % kSideUnit == 0 && box.nz % kSideUnit == 0,
                  "sides that can be halved twice");
  const ChannelShape fine = channel_shape(box, 0), half = channel_shape(box, 1),
                     quarter = channel_shape(box, 2);
  Channels a(fine, 8), b(fine, 8), c(half, 16), d(half, 16), e(quarter, 32), f(quarter, 32);
  {
    Channels in(fine, kInputs);
    fill_channel(smooth, 0, in);
    fill_channel(light, 1, in);
    convolve(layers_[0], in, a);
  }
  convolve(layers_[1], a, b);
  {
    Channels halved(half, 8);
    halve(b, halved);
    convolve(layers_[2], halved, c);
  }
  convolve(layers_[3], c, d);
  {
    Channels halved(quarter, 16);
    halve(d, halved);
    convolve(layers_[4], halved, e);
  }
  convolve(layers_[5], e, f);
  convolve_joined(layers_[6], d, f, c);
  convolve(layers_[7], c, d);
  convolve_joined(layers_[8], b, d, a);
  convolve(layers_[9], a, b);
  for (int z = 0; z < fine.nz; ++z) {
    for (int y = 0; y < fine.ny; ++y) {
      float* const to = smooth.data() + (static_cast<std::ptrdiff_t>(z) * fine.ny + y) * fine.nx;
      for (int channel = 0; channel < kLastChannels; ++channel) {
        const float* const values = b.row(channel, y, z);
        const float weight = last_[static_cast<std::size_t>(channel)];
        for (int x = 0; x < fine.nx; ++x) to[x] += weight * values[x];
      }
    }
  }
}

std::size_t Network::memory(const BoxShape& box) {
  const auto bytes = [&](int level, int channels) {
    return static_cast<std::size_t>(channels * channel_shape(box, level).stride_channel()) *
           sizeof(float);
  };
  return bytes(0, 8 + 8 + kInputs) + bytes(1, 16 + 16 + 8) + bytes(2, 32 + 32 + 16);
}

}  // namespace tomofield::prior
