#include "baseline/classical/variation_descent.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "baseline/classical/slab_gradient.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;
using projection::SampleSegment;

constexpr float kFloor = 1e-3f;  // ε, in density units a pixel

// Returns the factors of ∇.
GradientFactors per_spacing(const SampleSegment& segment) {
  return {static_cast<float>(1 / segment.hx), 1.0f, static_cast<float>(1 / segment.hz)};
}

// Returns Σ h_x h_z value(i)² over a slab's samples.
template <typename Value>
double sum_of_squares(const projection::SampleGrid& grid, Value&& value) {
  double sum = 0.0;
  for_each_sample_row(grid, [&](const SampleSegment& segment, std::ptrdiff_t row) {
    float sums[kLanes] = {};
    for (std::ptrdiff_t at = row; at < row + std::ptrdiff_t{segment.nx} * kLanes; at += kLanes) {
      for (int l = 0; l < kLanes; ++l) sums[l] += value(at + l) * value(at + l);
    }
    for (const float of_lane : sums) sum += segment.hx * segment.hz * static_cast<double>(of_lane);
  });
  return sum;
}

}  // namespace

VariationDescent::VariationDescent(const projection::SampleGrid& grid, std::int64_t num_rows)
    : px_(grid, num_rows), py_(grid, num_rows), pz_(grid, num_rows), gradient_(grid, num_rows) {}

double VariationDescent::step(double length, bool non_negative, VoxelVolume& densities) {
  const double variation = measure_directions(densities);
  const double slope = measure_gradient();
  if (slope == 0.0) return variation;
  const float rate = static_cast<float>(length / slope);
  const float lowest = non_negative ? 0.0f : std::numeric_limits<float>::lowest();
  base::parallel_for(densities.num_slabs(), [&](std::int64_t index) {
    const int slab = static_cast<int>(index);
    float* x = densities.slab(slab);
    const float* gradient = gradient_.slab(slab);
    for_each_sample_row(densities.grid(), [&](const SampleSegment& segment, std::ptrdiff_t row) {
      for (std::ptrdiff_t i = row; i < row + std::ptrdiff_t{segment.nx} * kLanes; ++i)
        x[i] = std::max(lowest, x[i] - rate * gradient[i]);
    });
  });
  return variation;
}

double VariationDescent::measure_directions(const VoxelVolume& densities) {
  return sum_over_slabs(densities.num_slabs(), [&](int slab) {
    double variation = 0.0;
    for_each_gradient_row(densities, slab, per_spacing, [&](const GradientRow& g) {
      float *px = px_.slab(slab) + g.row, *py = py_.slab(slab) + g.row,
            *pz = pz_.slab(slab) + g.row;
      float sums[kLanes] = {};
      for (std::size_t at = 0; at < g.count; at += kLanes) {
        for (std::size_t l = 0; l < kLanes; ++l) {
          const std::size_t i = at + l;
          const float m =
              std::sqrt(g.x[i] * g.x[i] + g.y[i] * g.y[i] + g.z[i] * g.z[i] + kFloor * kFloor);
          px[i] = g.x[i] / m;
          py[i] = g.y[i] / m;
          pz[i] = g.z[i] / m;
          sums[l] += m;
        }
      }
      for (int l = 0; l < densities.rows_in_slab(slab); ++l)
        variation += static_cast<double>(sums[l]) / static_cast<double>(g.factors.x * g.factors.z);
    });
    return variation;
  });
}

// Computes the gradient of the variation and returns its length.
double VariationDescent::measure_gradient() {
  return std::sqrt(sum_over_slabs(gradient_.num_slabs(), [&](int slab) {
    float* gradient = gradient_.slab(slab);
    std::fill_n(gradient, gradient_.grid().size(), 0.0f);
    add_gradient_adjoint(px_, py_, pz_, slab, per_spacing, gradient);
    return sum_of_squares(gradient_.grid(), [&](std::ptrdiff_t i) { return gradient[i]; });
  }));
}

double squared_distance(const projection::SampleGrid& grid, const float* x, const float* y) {
  return sum_of_squares(grid, [&](std::ptrdiff_t i) { return x[i] - y[i]; });
}

}  // namespace tomofield::baseline
