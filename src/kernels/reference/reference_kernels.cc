#include "kernels/reference/reference_kernels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "kernels/lanes.h"

namespace tomofield::kernels::reference {

void small_gemm(const SmallGemm& s, const double* a, const double* b, double* c) {
  for (std::ptrdiff_t m = 0; m < s.rows; ++m) {
    for (std::ptrdiff_t w = 0; w < s.width; ++w) {
      for (std::ptrdiff_t n = 0; n < s.depth; ++n) {
        c[m * s.c_row + w] += a[m * s.a_row + n * s.a_col] * b[n * s.b_row + w];
      }
    }
  }
}

double line_weight(const LineCrossing& line, int pixel, int sample) {
  const double position = static_cast<double>(line.offset) + static_cast<double>(line.step) * pixel;
  const bool sees = pixel >= line.first_pixel && pixel < line.end_pixel &&
                    position >= static_cast<double>(line.low) &&
                    position < static_cast<double>(line.high);
  const double hat = std::max(0.0, 1.0 - std::abs(position - sample));
  return sees ? static_cast<double>(line.weight) * hat : 0.0;
}

void project_line(const LineCrossing& line, int num_samples, std::ptrdiff_t stride, int first,
                  int end, const double* samples, double* detector) {
  for (int u = first; u < end; ++u) {
    for (int j = -1; j <= num_samples; ++j) {
      const double weight = line_weight(line, u, j);
      for (int lane = 0; lane < kLanes; ++lane) {
        detector[u * kLanes + lane] += weight * samples[j * stride + lane];
      }
    }
  }
}

void backproject_line(const LineCrossing& line, std::ptrdiff_t stride, int first, int end,
                      const double* detector, double* samples) {
  for (int j = first; j < end; ++j) {
    for (int u = line.first_pixel; u < line.end_pixel; ++u) {
      const double weight = line_weight(line, u, j);
      for (int lane = 0; lane < kLanes; ++lane) {
        samples[j * stride + lane] += weight * detector[u * kLanes + lane];
      }
    }
  }
}

double activation_value(Activation activation, double value) {
  const double beta = static_cast<double>(activation.beta);
  if (beta == 0.0) return value;
  return beta * value > 0 ? value + std::log1p(std::exp(-beta * value)) / beta
                          : std::log1p(std::exp(beta * value)) / beta;
}

double activation_derivative(Activation activation, double value) {
  const double beta = static_cast<double>(activation.beta);
  return beta == 0.0 ? 1.0 : 1.0 / (1.0 + std::exp(-beta * value));
}

namespace {

// Calls visit(position of the sample, {positions of its four vertices}, {their weights}).
template <typename Visit>
void for_each_sample(const LeafPiece& piece, Visit&& visit) {
  for (int x = 0; x < piece.x.count; ++x) {
    for (int z = 0; z < piece.z.count; ++z) {
      const double fx = static_cast<double>(piece.x.fraction[x]);
      const double fz = static_cast<double>(piece.z.fraction[z]);
      const auto vertex = [&](int i, int k) {
        return (static_cast<std::ptrdiff_t>(piece.x.lower[x] + i) * piece.num_vertices_z +
                piece.z.lower[z] + k) *
               kLanes;
      };
      visit(z * piece.stride_z + x * kLanes,
            std::array{vertex(0, 0), vertex(0, 1), vertex(1, 0), vertex(1, 1)},
            std::array{(1 - fx) * (1 - fz), (1 - fx) * fz, fx * (1 - fz), fx * fz});
    }
  }
}

}  // namespace

void decode_leaf(const LeafPiece& piece, const double* values, double* samples) {
  for_each_sample(piece, [&](std::ptrdiff_t sample, const auto& vertices, const auto& weights) {
    for (int lane = 0; lane < kLanes; ++lane) {
      double value = 0.0;
      for (int i = 0; i < 4; ++i) value += weights[i] * values[vertices[i] + lane];
      samples[sample + lane] = activation_value(piece.activation, value);
    }
  });
}

double decode_leaf_adjoint(const LeafPiece& piece, const double* values, const double* grad_samples,
                           double* grad_values) {
  double bias = 0.0;
  for_each_sample(piece, [&](std::ptrdiff_t sample, const auto& vertices, const auto& weights) {
    for (int lane = 0; lane < kLanes; ++lane) {
      double value = 0.0;
      for (int i = 0; i < 4; ++i) value += weights[i] * values[vertices[i] + lane];
      const double grad =
          grad_samples[sample + lane] * activation_derivative(piece.activation, value);
      for (int i = 0; i < 4; ++i) grad_values[vertices[i] + lane] += weights[i] * grad;
      bias += grad;
    }
  });
  return bias;
}

void interpolate_rows(const LaneTaps& taps, int width, const double* matrix, double* out) {
  for (int l = 0; l < kLanes; ++l) {
    const double f = static_cast<double>(taps.fraction[l]);
    for (int c = 0; c < width; ++c) {
      out[l * width + c] =
          (1 - f) * matrix[taps.lower[l] * width + c] + f * matrix[(taps.lower[l] + 1) * width + c];
    }
  }
}

void spread_rows(const LaneTaps& taps, int width, const double* grad, double* grad_matrix) {
  for (int l = 0; l < kLanes; ++l) {
    const double f = static_cast<double>(taps.fraction[l]);
    for (int c = 0; c < width; ++c) {
      grad_matrix[taps.lower[l] * width + c] += (1 - f) * grad[l * width + c];
      grad_matrix[(taps.lower[l] + 1) * width + c] += f * grad[l * width + c];
    }
  }
}

double volume_variation(const VolumeVariation& s, const double* volume, double* gradient) {
  const double epsilon = static_cast<double>(s.penalty.epsilon);
  const double tau = static_cast<double>(s.penalty.concavity);
  const auto at = [&](int x, int y, int z) {
    return (static_cast<std::ptrdiff_t>(z) * s.nx + x) * s.ny + y;
  };
  const int step_x = s.backward_x ? -1 : 1, step_z = s.backward_z ? -1 : 1;
  double value = 0.0;
  for (int z = 0; z < s.nz; ++z) {
    for (int x = 0; x < s.nx; ++x) {
      for (int y = 0; y < s.ny; ++y) {
        const auto here = at(x, y, z);
        const auto right = at(std::clamp(x + step_x, 0, s.nx - 1), y, z);
        const auto behind = at(x, std::min(y + 1, s.ny - 1), z);
        const auto up = at(x, y, std::clamp(z + step_z, 0, s.nz - 1));
        const double dx = s.per_hx * (volume[right] - volume[here]);
        const double dy = volume[behind] - volume[here];
        const double dz = s.per_hz * (volume[up] - volume[here]);
        const double m = std::sqrt(dx * dx + dy * dy + dz * dz + epsilon * epsilon);
        value += tau > 0 ? tau * std::log1p(m / tau) : m;
        const double slope = s.weight * (tau > 0 ? 1.0 / (1.0 + m / tau) : 1.0);
        gradient[right] += slope * s.per_hx * dx / m;
        gradient[behind] += slope * dy / m;
        gradient[up] += slope * s.per_hz * dz / m;
        gradient[here] -= slope * (s.per_hx * dx + dy + s.per_hz * dz) / m;
      }
    }
  }
  return s.weight * value;
}

namespace {

// Calls visit(vertex, hat weight) for every vertex around sample `index` of a piece.
template <typename Visit>
void for_each_vertex(const LeafVertices& leaf, const RayPiece& p, int index, Visit&& visit) {
  const double t = (index + static_cast<double>(random_unit(p.key, index))) / p.num_samples;
  const auto at = [t](float start, float span, int n) {
    return std::clamp(static_cast<double>(start) + t * static_cast<double>(span), 0.0, n - 1.0);
  };
  const double x = at(p.start_x, p.span_x, leaf.nx), y = at(p.start_y, p.span_y, leaf.ny),
               z = at(p.start_z, p.span_z, leaf.nz);
  for (int i = 0; i < leaf.nx; ++i) {
    for (int k = 0; k < leaf.nz; ++k) {
      for (int j = 0; j < leaf.ny; ++j) {
        const double weight = std::max(0.0, 1.0 - std::abs(x - i)) *
                              std::max(0.0, 1.0 - std::abs(y - j)) *
                              std::max(0.0, 1.0 - std::abs(z - k));
        if (weight > 0) visit((i * leaf.nz + k) * leaf.ny + j, weight);
      }
    }
  }
}

double value_at(const LeafVertices& leaf, const double* values, const RayPiece& piece, int index) {
  double value = 0.0;
  for_each_vertex(leaf, piece, index, [&](int v, double weight) { value += weight * values[v]; });
  return value;
}

}  // namespace

double integrate_piece(const LeafVertices& leaf, Activation activation, const double* values,
                       const RayPiece& piece) {
  double sum = 0.0;
  for (int i = 0; i < piece.num_samples; ++i)
    sum += activation_value(activation, value_at(leaf, values, piece, i));
  return sum * static_cast<double>(piece.segment_length);
}

double spread_piece(const LeafVertices& leaf, Activation activation, const double* values,
                    const RayPiece& piece, double g, double* grad_values) {
  double grad_bias = 0.0;
  for (int i = 0; i < piece.num_samples; ++i) {
    const double grad = g * static_cast<double>(piece.segment_length) *
                        activation_derivative(activation, value_at(leaf, values, piece, i));
    for_each_vertex(leaf, piece, i, [&](int v, double weight) { grad_values[v] += weight * grad; });
    grad_bias += grad;
  }
  return grad_bias;
}

void adam_step(const AdamStep& s, std::ptrdiff_t count, double* p, double* g, double* m,
               double* v) {
  const double beta1 = static_cast<double>(s.beta1), beta2 = static_cast<double>(s.beta2);
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    m[i] = beta1 * m[i] + (1 - beta1) * g[i];
    v[i] = beta2 * v[i] + (1 - beta2) * g[i] * g[i];
    p[i] -= static_cast<double>(s.rate_m) * m[i] /
            (std::sqrt(v[i]) * static_cast<double>(s.rate_v) + static_cast<double>(s.epsilon));
    g[i] = 0.0;
  }
}

namespace {

// Returns the vertex that lies where `i` would lie if the outer layers were mirrored.
int mirrored_vertex(int i, int n) {
  if (n == 1) return 0;
  if (i < 0) return -i;
  return i < n ? i : 2 * (n - 1) - i;
}

}  // namespace

void limit_spikes(const LatticeShape& s, int rank, double* values) {
  const std::vector<double> before(values, values + s.size());
  const auto at = [&](int x, int y, int z) {
    return (static_cast<std::size_t>(mirrored_vertex(x, s.nx)) * static_cast<std::size_t>(s.nz) +
            static_cast<std::size_t>(mirrored_vertex(z, s.nz))) *
               static_cast<std::size_t>(s.ny) +
           static_cast<std::size_t>(mirrored_vertex(y, s.ny));
  };
  for (int x = 0; x < s.nx; ++x) {
    for (int z = 0; z < s.nz; ++z) {
      for (int y = 0; y < s.ny; ++y) {
        std::vector<double> around;
        for (int i = 0; i < 27; ++i)
          if (i != 13)
            around.push_back(before[at(x + i / 9 - 1, y + i / 3 % 3 - 1, z + i % 3 - 1)]);
        std::sort(around.begin(), around.end());
        const auto lowest = static_cast<std::size_t>(rank - 1);
        values[at(x, y, z)] = std::clamp(values[at(x, y, z)], around[lowest], around[25 - lowest]);
      }
    }
  }
}

void convolve(const ChannelShape& shape, const Convolution& c, const double* in, double* out) {
  constexpr int kTogether = kOutputsTogether;
  const auto weight = [&](int o, int i, int tap) {
    return static_cast<double>(
        c.weights[((o / kTogether * c.num_in + i) * 27 + tap) * kTogether + o % kTogether]);
  };
  for (int o = 0; o < c.num_out; ++o) {
    for (int voxel = 0; voxel < shape.nx * shape.ny * shape.nz; ++voxel) {
      const int x = voxel % shape.nx, y = voxel / shape.nx % shape.ny,
                z = voxel / (shape.nx * shape.ny);
      double sum = 0.0;
      for (int i = 0; i < c.num_in; ++i)
        for (int tap = 0; tap < 27; ++tap)
          sum += weight(o, i, tap) *
                 in[i * shape.stride_channel() +
                    shape.at(x + tap % 3 - 1, y + tap / 3 % 3 - 1, z + tap / 9 - 1)];
      out[o * shape.stride_channel() + shape.at(x, y, z)] =
          sum > 0 ? sum : static_cast<double>(c.slope) * sum;
    }
  }
}

}  // namespace tomofield::kernels::reference
