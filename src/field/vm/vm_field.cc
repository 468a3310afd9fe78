#include "field/vm/vm_field.h"

#include <algorithm>
#include <array>
#include <vector>

#include "base/aligned_buffer.h"
#include "field/array_variation.h"
#include "field/sampling/resample.h"
#include "field/vm/merge_factors.h"
#include "kernels/point_products.h"
#include "kernels/row_interpolation.h"
#include "kernels/small_gemm.h"

namespace tomofield::field {
namespace {

using kernels::add_transposed;
using kernels::interpolate_rows;
using kernels::kLanes;
using kernels::small_gemm;
using kernels::spread_rows;
using kernels::transpose_lanes;

// One of the three products of eq. 4 at points, and the offsets of its factors.
struct Product {
  kernels::PointProducts points;
  std::size_t vector, matrix;
};
std::array<Product, 3> products(const LeafShape& s, const PointTaps& t) {
  const VmLayout at(s);
  return {Product{{t.x, t.z, t.y, s.ny, s.rank_x}, at.vx, at.myz},
          Product{{t.y, t.x, t.z, s.nz, s.rank_y}, at.vy, at.mxz},
          Product{{t.z, t.x, t.y, s.ny, s.rank_z}, at.vz, at.mxy}};
}
// A matrix product at the rows of a slab: values[first_value + row · value_row + lane] is a sum
// over ranks of factor[row, rank] times plane[y, rank] at the lane's y.
struct SlabProduct {
  std::ptrdiff_t rows, first_value, value_row;
  int rank;
  std::size_t factor, plane;
};

// Calls body for the products of a slab: one for VY ⊗ MXZ, one for each vertex in z for VX ⊗ MYZ,
// and one for each vertex in x for VZ ⊗ MXY.
template <typename Body>
void for_each_slab_product(const LeafShape& s, const Body& body) {
  const VmLayout at(s);
  const std::ptrdiff_t column = static_cast<std::ptrdiff_t>(s.nz) * kLanes;
  const auto plane = [&s](int index, int rank) {
    return static_cast<std::size_t>(index) * static_cast<std::size_t>(s.ny) *
           static_cast<std::size_t>(rank);
  };
  body(SlabProduct{static_cast<std::ptrdiff_t>(s.vertices_xz()), 0, kLanes, s.rank_y, at.mxz,
                   at.vy});
  for (int k = 0; k < s.nz; ++k)
    body(SlabProduct{s.nx, k * kLanes, column, s.rank_x, at.vx, at.myz + plane(k, s.rank_x)});
  for (int i = 0; i < s.nx; ++i)
    body(SlabProduct{s.nz, i * column, kLanes, s.rank_z, at.vz, at.mxy + plane(i, s.rank_z)});
}

// Returns the size of a plane's rows at the lanes, in floats.
std::size_t lane_size(const LeafShape& s) {
  return static_cast<std::size_t>(std::max({s.rank_x, s.rank_y, s.rank_z})) * kLanes;
}

// Returns scratch memory that a thread keeps between calls.
float* scratch(std::size_t size, int which) {
  thread_local base::AlignedBuffer<float> buffers[2];
  buffers[which].reserve(size);
  return buffers[which].data();
}

// A plane's rows at the lanes of a slab, [lane, rank]. If all lanes lie at vertices, these are the
// rows of the plane itself.
struct PlaneRows {
  PlaneRows(const LeafShape& s, const LaneRows& rows)
      : taps{rows.lower.data(), rows.fraction.data()},
        at_vertices(rows.are_at_neighbouring_vertices()),
        scratch_size(lane_size(s)) {}

  const float* at_lanes(const float* plane, int rank) const {
    if (at_vertices) return plane + first(rank);
    float* lanes = scratch(scratch_size, 0);
    interpolate_rows(taps, rank, plane, lanes);
    return lanes;
  }
  // Adds a gradient [rank, lane] to the gradient of the plane.
  void add(const float* by_rank, int rank, float* plane) const {
    if (at_vertices) return add_transposed(rank, by_rank, plane + first(rank));
    float* lanes = scratch(scratch_size, 0);
    std::fill_n(lanes, rank * kLanes, 0.0f);
    add_transposed(rank, by_rank, lanes);
    spread_rows(taps, rank, lanes, plane);
  }

 private:
  std::size_t first(int rank) const {
    return static_cast<std::size_t>(taps.lower[0]) * static_cast<std::size_t>(rank);
  }
  kernels::LaneTaps taps;
  bool at_vertices;
  std::size_t scratch_size;
};

}  // namespace

std::size_t VmField::count(const LeafShape& shape) { return VmLayout(shape).count; }

// VX, MXZ and VZ have no y. In the others, y comes after z or x and before the rank.
std::vector<ParameterRuns> VmField::runs_of_rows(const LeafShape& s, int first_y, int end_y) const {
  const VmLayout at(s);
  const auto rows = [&](std::size_t factor, int rank, int repeats) {
    const auto width = static_cast<std::size_t>(rank);
    return ParameterRuns{factor + static_cast<std::size_t>(first_y) * width,
                         static_cast<std::size_t>(end_y - first_y) * width,
                         static_cast<std::size_t>(s.ny) * width, static_cast<std::size_t>(repeats)};
  };
  return {{at.vx, at.myz - at.vx},
          rows(at.myz, s.rank_x, s.nz),
          rows(at.vy, s.rank_y, 1),
          {at.mxz, at.mxy - at.mxz},
          rows(at.mxy, s.rank_z, s.nx)};
}

void VmField::add_slab_values(int leaf, const LaneRows& rows, float* values) const {
  const LeafShape& s = shape(leaf);
  const float* p = leaf_parameters(leaf);
  const PlaneRows plane_rows(s, rows);
  float* by_rank = scratch(lane_size(s), 1);
  for_each_slab_product(s, [&](const SlabProduct& f) {
    transpose_lanes(f.rank, plane_rows.at_lanes(p + f.plane, f.rank), by_rank);
    small_gemm({.rows = f.rows,
                .depth = f.rank,
                .width = kLanes,
                .a = p + f.factor,
                .a_row = f.rank,
                .a_col = 1,
                .b = by_rank,
                .b_row = kLanes,
                .c = values + f.first_value,
                .c_row = f.value_row});
  });
}

// Every gradient is a matrix product whose columns are ranks or lanes. The sums over the other
// indices are part of the product's depth.
void VmField::slab_gradient(int leaf, const LaneRows& rows, const float* grad_values,
                            float* gradient) const {
  const LeafShape& s = shape(leaf);
  const float* p = leaf_parameters(leaf);
  const PlaneRows plane_rows(s, rows);
  float* by_rank = scratch(lane_size(s), 1);
  for_each_slab_product(s, [&](const SlabProduct& f) {
    const float* grad = grad_values + f.first_value;
    small_gemm({.rows = f.rows,
                .depth = kLanes,
                .width = f.rank,
                .a = grad,
                .a_row = f.value_row,
                .a_col = 1,
                .b = plane_rows.at_lanes(p + f.plane, f.rank),
                .b_row = f.rank,
                .c = gradient + f.factor,
                .c_row = f.rank});
    std::fill_n(by_rank, f.rank * kLanes, 0.0f);
    small_gemm({.rows = f.rank,
                .depth = f.rows,
                .width = kLanes,
                .a = p + f.factor,
                .a_row = 1,
                .a_col = f.rank,
                .b = grad,
                .b_row = f.value_row,
                .c = by_rank,
                .c_row = kLanes});
    plane_rows.add(by_rank, f.rank, gradient + f.plane);
  });
}

void VmField::add_row_values(int leaf, int lower, float fraction, float* values) const {
  const LeafShape& s = shape(leaf);
  const VmLayout at(s);
  const float* p = leaf_parameters(leaf);
  const auto row_of = [&](const float* factor, int rank, int r) {
    const float* a = factor + static_cast<std::ptrdiff_t>(lower) * rank + r;
    return a[0] + fraction * (a[rank] - a[0]);
  };
  // The operands are [r, z], so that the products run along z.
  float* by_rank = scratch(static_cast<std::size_t>(std::max(s.rank_x, s.rank_z)) * s.nz, 0);
  for (int k = 0; k < s.nz; ++k) {
    const float* plane = p + at.myz + static_cast<std::size_t>(k) * s.ny * s.rank_x;
    for (int r = 0; r < s.rank_x; ++r) by_rank[r * s.nz + k] = row_of(plane, s.rank_x, r);
  }
  small_gemm({.rows = s.nx,
              .depth = s.rank_x,
              .width = s.nz,
              .a = p + at.vx,
              .a_row = s.rank_x,
              .a_col = 1,
              .b = by_rank,
              .b_row = s.nz,
              .c = values,
              .c_row = s.nz});
  for (int k = 0; k < s.nz; ++k) {
    for (int r = 0; r < s.rank_z; ++r)
      by_rank[r * s.nz + k] = p[at.vz + static_cast<std::size_t>(k) * s.rank_z + r];
  }
  std::vector<float> row(static_cast<std::size_t>(std::max(s.rank_y, s.rank_z)));
  for (int i = 0; i < s.nx; ++i) {
    const float* plane = p + at.mxy + static_cast<std::size_t>(i) * s.ny * s.rank_z;
    for (int r = 0; r < s.rank_z; ++r)
      row[static_cast<std::size_t>(r)] = row_of(plane, s.rank_z, r);
    small_gemm({.rows = 1,
                .depth = s.rank_z,
                .width = s.nz,
                .a = row.data(),
                .a_row = 0,
                .a_col = 1,
                .b = by_rank,
                .b_row = s.nz,
                .c = values + static_cast<std::ptrdiff_t>(i) * s.nz,
                .c_row = 0});
  }
  for (int r = 0; r < s.rank_y; ++r)
    row[static_cast<std::size_t>(r)] = row_of(p + at.vy, s.rank_y, r);
  small_gemm({.rows = static_cast<std::ptrdiff_t>(s.vertices_xz()),
              .depth = s.rank_y,
              .width = 1,
              .a = p + at.mxz,
              .a_row = s.rank_y,
              .a_col = 1,
              .b = row.data(),
              .b_row = 1,
              .c = values,
              .c_row = 1});
}

void VmField::add_point_values(int leaf, const PointTaps& taps, float* values) const {
  for (const Product& f : products(shape(leaf), taps)) {
    const float* p = leaf_parameters(leaf);
    kernels::add_point_products(f.points, p + f.vector, p + f.matrix, values);
  }
}

void VmField::add_point_gradient(int leaf, const PointTaps& taps, const float* grad_values,
                                 float* gradient) const {
  for (const Product& f : products(shape(leaf), taps)) {
    const float* p = leaf_parameters(leaf);
    kernels::add_point_products_gradient(f.points, p + f.vector, p + f.matrix, grad_values,
                                         gradient + f.vector, gradient + f.matrix);
  }
}

double VmField::parameter_variation(int leaf, const kernels::VariationPenalty& penalty,
                                    double weight, float* gradient) const {
  constexpr double kVectorShare = 0.1;  // α of eq. 5
  const LeafShape& s = shape(leaf);
  const VmLayout at(s);
  const float* p = leaf_parameters(leaf);
  const auto vector = [&](std::size_t where, int n, int rank) {
    return array_variation(p + where, 1, 1, n, rank, penalty, kVectorShare * weight,
                           gradient + where);
  };
  const auto matrix = [&](std::size_t where, int n0, int n1, int rank) {
    return array_variation(p + where, 1, n0, n1, rank, penalty, weight, gradient + where);
  };
  return vector(at.vx, s.nx, s.rank_x) + matrix(at.myz, s.nz, s.ny, s.rank_x) +
         vector(at.vy, s.ny, s.rank_y) + matrix(at.mxz, s.nx, s.nz, s.rank_y) +
         vector(at.vz, s.nz, s.rank_z) + matrix(at.mxy, s.nx, s.ny, s.rank_z);
}

void VmField::sample_quarter(const LeafShape& s, const float* leaf, double x0, double y0,
                             float* quarter) const {
  const VmLayout at(s);
  const double x_first = x0 * (s.nx - 1), y_first = y0 * (s.ny - 1);
  const auto copy = [&](std::size_t from, std::size_t to) {
    std::copy(leaf + from, leaf + to, quarter + from);
  };
  halve_axis(leaf + at.vx, 1, s.nx, s.rank_x, x_first, quarter + at.vx);
  halve_axis(leaf + at.myz, s.nz, s.ny, s.rank_x, y_first, quarter + at.myz);
  halve_axis(leaf + at.vy, 1, s.ny, s.rank_y, y_first, quarter + at.vy);
  halve_axis(leaf + at.mxz, 1, s.nx, s.nz * s.rank_y, x_first, quarter + at.mxz);
  copy(at.vz, at.mxy);
  std::vector<float> along_x(static_cast<std::size_t>(s.nx) * s.ny * s.rank_z);
  halve_axis(leaf + at.mxy, 1, s.nx, s.ny * s.rank_z, x_first, along_x.data());
  halve_axis(along_x.data(), s.nx, s.ny, s.rank_z, y_first, quarter + at.mxy);
}

void VmField::resample_leaf(const LeafShape& f, const float* from, const LeafShape& t,
                            float* to) const {
  const VmLayout at(f), into(t);
  // Matrices are [slow, fast, rank]; the slow axis is resampled first.
  const auto matrix = [&](std::size_t where, int slow, int fast, int rank, std::size_t target,
                          int new_slow, int new_fast) {
    std::vector<float> along_slow(static_cast<std::size_t>(new_slow) * fast * rank);
    resample_axis(from + where, 1, slow, fast * rank, new_slow, along_slow.data());
    resample_axis(along_slow.data(), new_slow, fast, rank, new_fast, to + target);
  };
  resample_axis(from + at.vx, 1, f.nx, f.rank_x, t.nx, to + into.vx);
  matrix(at.myz, f.nz, f.ny, f.rank_x, into.myz, t.nz, t.ny);
  resample_axis(from + at.vy, 1, f.ny, f.rank_y, t.ny, to + into.vy);
  matrix(at.mxz, f.nx, f.nz, f.rank_y, into.mxz, t.nx, t.nz);
  resample_axis(from + at.vz, 1, f.nz, f.rank_z, t.nz, to + into.vz);
  matrix(at.mxy, f.nx, f.ny, f.rank_z, into.mxy, t.nx, t.ny);
}

void VmField::join_leaves(const LeafShape& s, const Quarters& leaves, float* joined) const {
  const VmLayout at(s);
  const auto join = [&](std::size_t where, const ArrayExtents& extents) {
    Quarters factor = leaves;
    for (const float*& quarter : factor) quarter += where;
    join_quarters(factor, extents, joined + where);
  };
  join(at.vx, {.x = s.nx, .inner = s.rank_x});
  join(at.myz, {.middle = s.nz, .y = s.ny, .inner = s.rank_x});
  join(at.vy, {.y = s.ny, .inner = s.rank_y});
  join(at.mxz, {.x = s.nx, .middle = s.nz, .inner = s.rank_y});
  join(at.vz, {.middle = s.nz, .inner = s.rank_z});
  join(at.mxy, {.x = s.nx, .y = s.ny, .inner = s.rank_z});
}

void VmField::fit_merged(const LeafShape& s, const MergeTarget& target, float* parameters) const {
  merge_factors(s, target, parameters);
}

}  // namespace tomofield::field
