#include "field/grid/grid_field.h"

#include <algorithm>
#include <vector>

#include "field/array_variation.h"
#include "field/merge_target.h"
#include "field/sampling/resample.h"
#include "kernels/column_interpolation.h"
#include "kernels/small_gemm.h"
#include "kernels/spikes.h"

namespace tomofield::field {
namespace {

using kernels::kLanes;
using kernels::small_gemm;

// The interpolation along y as a small dense matrix over the vertices that the slab's rows touch,
// [first, first + count).
struct RowMatrix {
  int first, count;
  std::vector<float> by_vertex;  // [vertex, lane]
  std::vector<float> by_lane;    // [lane, vertex]
  explicit RowMatrix(const LaneRows& rows) {
    const auto [low, high] = std::minmax_element(rows.lower.begin(), rows.lower.end());
    first = *low;
    count = *high + 2 - first;
    by_vertex.assign(static_cast<std::size_t>(count) * kLanes, 0.0f);
    by_lane.assign(by_vertex.size(), 0.0f);
    for (int l = 0; l < kLanes; ++l) {
      const int j = rows.lower[l] - first;
      add(j, l, 1.0f - rows.fraction[l]);
      add(j + 1, l, rows.fraction[l]);
    }
  }

 private:
  void add(int vertex, int lane, float weight) {
    by_vertex[static_cast<std::size_t>(vertex * kLanes + lane)] += weight;
    by_lane[static_cast<std::size_t>(lane * count + vertex)] += weight;
  }
};

kernels::Columns columns(const LeafShape& s, const LaneRows& rows) {
  return {.count = static_cast<std::ptrdiff_t>(s.vertices_xz()),
          .stride = s.ny,
          .fraction = rows.fraction.data()};
}

// Calls body(vertex, weight) for the eight vertices around a point.
template <typename Body>
void for_each_corner(const LeafShape& s, const PointTaps& taps, int point, const Body& body) {
  const auto weight = [point](const kernels::AxisTaps& axis, int upper) {
    return upper ? axis.fraction[point] : 1.0f - axis.fraction[point];
  };
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 2; ++k) {
      const float w = weight(taps.x, i) * weight(taps.z, k);
      const std::ptrdiff_t column =
          (static_cast<std::ptrdiff_t>(taps.x.lower[point] + i) * s.nz + taps.z.lower[point] + k) *
              s.ny +
          taps.y.lower[point];
      body(column, w * weight(taps.y, 0));
      body(column + 1, w * weight(taps.y, 1));
    }
  }
}

}  // namespace

std::size_t GridField::count(const LeafShape& s) { return s.vertices_xz() * s.ny; }

std::vector<ParameterRuns> GridField::runs_of_rows(const LeafShape& s, int first_y,
                                                   int end_y) const {
  const auto first = static_cast<std::size_t>(first_y),
             count = static_cast<std::size_t>(end_y) - first;
  return {{first, count, static_cast<std::size_t>(s.ny), s.vertices_xz()}};
}

void GridField::add_slab_values(int leaf, const LaneRows& rows, float* values) const {
  const LeafShape& s = shape(leaf);
  if (rows.are_a_vertex_apart()) {
    kernels::interpolate_columns(columns(s, rows), leaf_parameters(leaf) + rows.lower[0], values);
    return;
  }
  const RowMatrix m(rows);
  small_gemm({.rows = static_cast<std::ptrdiff_t>(s.vertices_xz()),
              .depth = m.count,
              .width = kLanes,
              .a = leaf_parameters(leaf) + m.first,
              .a_row = s.ny,
              .a_col = 1,
              .b = m.by_vertex.data(),
              .b_row = kLanes,
              .c = values,
              .c_row = kLanes});
}

void GridField::slab_gradient(int leaf, const LaneRows& rows, const float* grad_values,
                              float* gradient) const {
  const LeafShape& s = shape(leaf);
  if (rows.are_a_vertex_apart()) {
    kernels::spread_columns(columns(s, rows), grad_values, gradient + rows.lower[0]);
    return;
  }
  const RowMatrix m(rows);
  small_gemm({.rows = static_cast<std::ptrdiff_t>(s.vertices_xz()),
              .depth = kLanes,
              .width = m.count,
              .a = grad_values,
              .a_row = kLanes,
              .a_col = 1,
              .b = m.by_lane.data(),
              .b_row = m.count,
              .c = gradient + m.first,
              .c_row = s.ny});
}

void GridField::add_row_values(int leaf, int lower, float fraction, float* values) const {
  const LeafShape& s = shape(leaf);
  const float* p = leaf_parameters(leaf) + lower;
  for (std::size_t i = 0; i < s.vertices_xz(); ++i, p += s.ny)
    values[i] += p[0] + fraction * (p[1] - p[0]);
}

void GridField::add_point_values(int leaf, const PointTaps& taps, float* values) const {
  const float* p = leaf_parameters(leaf);
  for (int n = 0; n < taps.count(); ++n) {
    for_each_corner(shape(leaf), taps, n,
                    [&](std::ptrdiff_t vertex, float weight) { values[n] += weight * p[vertex]; });
  }
}

void GridField::add_point_gradient(int leaf, const PointTaps& taps, const float* grad_values,
                                   float* gradient) const {
  for (int n = 0; n < taps.count(); ++n) {
    for_each_corner(shape(leaf), taps, n, [&](std::ptrdiff_t vertex, float weight) {
      gradient[vertex] += weight * grad_values[n];
    });
  }
}

double GridField::parameter_variation(int leaf, const kernels::VariationPenalty& penalty,
                                      double weight, float* gradient) const {
  const LeafShape& s = shape(leaf);
  return array_variation(leaf_parameters(leaf), s.nx, s.nz, s.ny, 1, penalty, weight, gradient);
}

void GridField::limit_spikes(int leaf, int rank) {
  const LeafShape& s = shape(leaf);
  kernels::limit_spikes({.nx = s.nx, .ny = s.ny, .nz = s.nz}, rank, leaf_parameters(leaf));
}

void GridField::sample_quarter(const LeafShape& s, const float* leaf, double x0, double y0,
                               float* quarter) const {
  std::vector<float> along_x(parameter_count(s));
  halve_axis(leaf, 1, s.nx, s.nz * s.ny, x0 * (s.nx - 1), along_x.data());
  halve_axis(along_x.data(), s.nx * s.nz, s.ny, 1, y0 * (s.ny - 1), quarter);
}

void GridField::resample_leaf(const LeafShape& f, const float* from, const LeafShape& t,
                              float* to) const {
  std::vector<float> along_x(static_cast<std::size_t>(t.nx) * f.nz * f.ny);
  std::vector<float> along_xz(static_cast<std::size_t>(t.nx) * t.nz * f.ny);
  resample_axis(from, 1, f.nx, f.nz * f.ny, t.nx, along_x.data());
  resample_axis(along_x.data(), t.nx, f.nz, f.ny, t.nz, along_xz.data());
  resample_axis(along_xz.data(), t.nx * t.nz, f.ny, 1, t.ny, to);
}

void GridField::join_leaves(const LeafShape& s, const Quarters& leaves, float* joined) const {
  join_quarters(leaves, {.x = s.nx, .middle = s.nz, .y = s.ny}, joined);
}

// Solves a = Lx⁻ᵀ B Ly⁻¹.
void GridField::fit_merged(const LeafShape& s, const MergeTarget& target, float* parameters) const {
  RowMajorMatrix a = target.b;
  target.chol_x.transpose().triangularView<Eigen::Upper>().solveInPlace(a);
  const Eigen::Map<const RowMajorMatrix> columns(a.data(), a.rows() * s.nz, s.ny);
  const RowMajorMatrix solved = target.chol_y.transpose()
                                    .triangularView<Eigen::Upper>()
                                    .solve(columns.transpose())
                                    .transpose();
  std::copy_n(solved.data(), solved.size(), parameters);
}

}  // namespace tomofield::field
