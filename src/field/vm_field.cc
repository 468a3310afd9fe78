#include "field/vm_field.h"

#include <algorithm>
#include <array>
#include <vector>

#include "base/aligned_buffer.h"
#include "field/merge_factors.h"
#include "field/merge_target.h"
#include "field/resample.h"
#include "field/variation_planes.h"
#include "kernels/point_products.h"
#include "kernels/row_interpolation.h"
#include "kernels/small_gemm.h"

namespace tomofield::field {
namespace {

using kernels::interpolate_rows;
using kernels::interpolate_rows_transposed;
using kernels::kLanes;
using kernels::small_gemm;
using kernels::spread_rows;

// Positions of the six factors inside a leaf's parameters.
struct Layout {
  std::size_t vx, myz, vy, mxz, vz, mxy, count;
  explicit Layout(const LeafShape& s) {
    const auto size = [](int a, int b, int c) { return static_cast<std::size_t>(a) * b * c; };
    vx = 0;
    myz = vx + size(s.nx, 1, s.rank_x);
    vy = myz + size(s.nz, s.ny, s.rank_x);
    mxz = vy + size(s.ny, 1, s.rank_y);
    vz = mxz + size(s.nx, s.nz, s.rank_y);
    mxy = vz + size(s.nz, 1, s.rank_z);
    count = mxy + size(s.nx, s.ny, s.rank_z);
  }
};

// The three products of eq. 4 at points, and where their factors lie.
struct Product {
  kernels::PointProducts points;
  std::size_t vector, matrix;
};
std::array<Product, 3> products(const LeafShape& s, const PointTaps& t) {
  const Layout at(s);
  return {Product{{t.x, t.z, t.y, s.ny, s.rank_x}, at.vx, at.myz},
          Product{{t.y, t.x, t.z, s.nz, s.rank_y}, at.vy, at.mxz},
          Product{{t.z, t.x, t.y, s.ny, s.rank_z}, at.vz, at.mxy}};
}
// Factors between a leaf's parameters and the coordinates of a merge.
class FactorMaps {
 public:
  FactorMaps(const LeafShape& shape, const MergeTarget& target)
      : s_(shape), at_(shape), target_(target) {}

  LeafFactors read(const float* p) const {
    LeafFactors f;
    f.vx = factor(p + at_.vx, s_.nx, s_.rank_x);
    f.myz = factor(p + at_.myz, s_.nz * s_.ny, s_.rank_x);
    f.vy = factor(p + at_.vy, s_.ny, s_.rank_y);
    f.mxz = factor(p + at_.mxz, s_.nx * s_.nz, s_.rank_y);
    f.vz = factor(p + at_.vz, s_.nz, s_.rank_z);
    f.mxy = factor(p + at_.mxy, s_.nx * s_.ny, s_.rank_z);
    const auto times = [](const Eigen::MatrixXd& chol) {
      return [&chol](auto&& block) { block = (chol.transpose() * block).eval(); };
    };
    apply(f, times(target_.chol_x), times(target_.chol_y));
    return f;
  }

  void write(LeafFactors f, float* p) const {
    const auto solve = [](const Eigen::MatrixXd& chol) {
      return [&chol](auto&& block) {
        block = chol.transpose().triangularView<Eigen::Upper>().solve(block.eval()).eval();
      };
    };
    apply(f, solve(target_.chol_x), solve(target_.chol_y));
    const auto copy = [p](const RowMajorMatrix& from, std::size_t to) {
      std::copy_n(from.data(), from.size(), p + to);
    };
    copy(f.vx, at_.vx);
    copy(f.myz, at_.myz);
    copy(f.vy, at_.vy);
    copy(f.mxz, at_.mxz);
    copy(f.vz, at_.vz);
    copy(f.mxy, at_.mxy);
  }

 private:
  static RowMajorMatrix factor(const float* p, Eigen::Index rows, Eigen::Index rank) {
    using Floats = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    return Eigen::Map<const Floats>(p, rows, rank).cast<double>();
  }

  // Along x of three factors and along y of three.
  template <typename AlongX, typename AlongY>
  void apply(LeafFactors& f, const AlongX& along_x, const AlongY& along_y) const {
    const auto flat = [](RowMajorMatrix& m, Eigen::Index rows) {
      return Eigen::Map<RowMajorMatrix>(m.data(), rows, m.size() / rows);
    };
    along_x(flat(f.vx, s_.nx));
    along_x(flat(f.mxz, s_.nx));
    along_x(flat(f.mxy, s_.nx));
    along_y(flat(f.vy, s_.ny));
    for (int k = 0; k < s_.nz; ++k)
      along_y(f.myz.middleRows(static_cast<Eigen::Index>(k) * s_.ny, s_.ny));
    for (int i = 0; i < s_.nx; ++i)
      along_y(f.mxy.middleRows(static_cast<Eigen::Index>(i) * s_.ny, s_.ny));
  }

  const LeafShape& s_;
  Layout at_;
  const MergeTarget& target_;
};

// Scratch that a thread keeps between calls.
float* scratch(std::size_t size, int which) {
  thread_local base::AlignedBuffer<float> buffers[3];
  buffers[which].reserve(size);
  return buffers[which].data();
}

}  // namespace

std::size_t VmField::count(const LeafShape& shape) { return Layout(shape).count; }

// VX, MXZ and VZ have no y; of the others, y comes after z or x and before the rank.
std::vector<ParameterRuns> VmField::runs_of_rows(const LeafShape& s, int first_y, int end_y) const {
  const Layout at(s);
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
  const Layout at(s);
  const kernels::LaneTaps taps{rows.lower.data(), rows.fraction.data()};
  const float* p = leaf_parameters(leaf);
  const int max_rank = std::max({s.rank_x, s.rank_y, s.rank_z});
  float* lanes = scratch(static_cast<std::size_t>(max_rank) * kLanes, 0);
  const std::ptrdiff_t column = static_cast<std::ptrdiff_t>(s.nz) * kLanes;

  interpolate_rows_transposed(taps, s.rank_y, p + at.vy, lanes);
  small_gemm({.rows = static_cast<std::ptrdiff_t>(s.vertices_xz()),
              .depth = s.rank_y,
              .width = kLanes,
              .a = p + at.mxz,
              .a_row = s.rank_y,
              .a_col = 1,
              .b = lanes,
              .b_row = kLanes,
              .c = values,
              .c_row = kLanes});
  for (int k = 0; k < s.nz; ++k) {
    interpolate_rows_transposed(taps, s.rank_x,
                                p + at.myz + static_cast<std::size_t>(k) * s.ny * s.rank_x, lanes);
    small_gemm({.rows = s.nx,
                .depth = s.rank_x,
                .width = kLanes,
                .a = p + at.vx,
                .a_row = s.rank_x,
                .a_col = 1,
                .b = lanes,
                .b_row = kLanes,
                .c = values + k * kLanes,
                .c_row = column});
  }
  for (int i = 0; i < s.nx; ++i) {
    interpolate_rows_transposed(taps, s.rank_z,
                                p + at.mxy + static_cast<std::size_t>(i) * s.ny * s.rank_z, lanes);
    small_gemm({.rows = s.nz,
                .depth = s.rank_z,
                .width = kLanes,
                .a = p + at.vz,
                .a_row = s.rank_z,
                .a_col = 1,
                .b = lanes,
                .b_row = kLanes,
                .c = values + i * column,
                .c_row = kLanes});
  }
}

// Every gradient is a matrix product whose columns are ranks: the sums over
// lanes are part of the product's depth, so no register is ever summed across.
void VmField::slab_gradient(int leaf, const LaneRows& rows, const float* grad_values,
                            float* gradient) const {
  const LeafShape& s = shape(leaf);
  const Layout at(s);
  const kernels::LaneTaps taps{rows.lower.data(), rows.fraction.data()};
  const float* p = leaf_parameters(leaf);
  const int max_rank = std::max({s.rank_x, s.rank_y, s.rank_z});
  const std::size_t lane_size = static_cast<std::size_t>(max_rank) * kLanes;
  float* lanes = scratch(lane_size, 0);
  float* grad_lanes = scratch(lane_size, 1);
  const std::ptrdiff_t column = static_cast<std::ptrdiff_t>(s.nz) * kLanes;
  const std::ptrdiff_t num_xz = static_cast<std::ptrdiff_t>(s.vertices_xz());

  // VY ⊗ MXZ
  interpolate_rows(taps, s.rank_y, p + at.vy, lanes);
  std::fill_n(grad_lanes, lane_size, 0.0f);
  small_gemm({.rows = num_xz,
              .depth = kLanes,
              .width = s.rank_y,
              .a = grad_values,
              .a_row = kLanes,
              .a_col = 1,
              .b = lanes,
              .b_row = s.rank_y,
              .c = gradient + at.mxz,
              .c_row = s.rank_y});
  small_gemm({.rows = kLanes,
              .depth = num_xz,
              .width = s.rank_y,
              .a = grad_values,
              .a_row = 1,
              .a_col = kLanes,
              .b = p + at.mxz,
              .b_row = s.rank_y,
              .c = grad_lanes,
              .c_row = s.rank_y});
  spread_rows(taps, s.rank_y, grad_lanes, gradient + at.vy);

  // VX ⊗ MYZ
  for (int k = 0; k < s.nz; ++k) {
    const std::size_t plane = at.myz + static_cast<std::size_t>(k) * s.ny * s.rank_x;
    const float* g = grad_values + k * kLanes;
    interpolate_rows(taps, s.rank_x, p + plane, lanes);
    std::fill_n(grad_lanes, lane_size, 0.0f);
    small_gemm({.rows = s.nx,
                .depth = kLanes,
                .width = s.rank_x,
                .a = g,
                .a_row = column,
                .a_col = 1,
                .b = lanes,
                .b_row = s.rank_x,
                .c = gradient + at.vx,
                .c_row = s.rank_x});
    small_gemm({.rows = kLanes,
                .depth = s.nx,
                .width = s.rank_x,
                .a = g,
                .a_row = 1,
                .a_col = column,
                .b = p + at.vx,
                .b_row = s.rank_x,
                .c = grad_lanes,
                .c_row = s.rank_x});
    spread_rows(taps, s.rank_x, grad_lanes, gradient + plane);
  }

  // VZ ⊗ MXY
  for (int i = 0; i < s.nx; ++i) {
    const std::size_t plane = at.mxy + static_cast<std::size_t>(i) * s.ny * s.rank_z;
    const float* g = grad_values + i * column;
    interpolate_rows(taps, s.rank_z, p + plane, lanes);
    std::fill_n(grad_lanes, lane_size, 0.0f);
    small_gemm({.rows = s.nz,
                .depth = kLanes,
                .width = s.rank_z,
                .a = g,
                .a_row = kLanes,
                .a_col = 1,
                .b = lanes,
                .b_row = s.rank_z,
                .c = gradient + at.vz,
                .c_row = s.rank_z});
    small_gemm({.rows = kLanes,
                .depth = s.nz,
                .width = s.rank_z,
                .a = g,
                .a_row = 1,
                .a_col = kLanes,
                .b = p + at.vz,
                .b_row = s.rank_z,
                .c = grad_lanes,
                .c_row = s.rank_z});
    spread_rows(taps, s.rank_z, grad_lanes, gradient + plane);
  }
}

void VmField::add_row_values(int leaf, int lower, float fraction, float* values) const {
  const LeafShape& s = shape(leaf);
  const Layout at(s);
  const float* p = leaf_parameters(leaf);
  const auto row_of = [&](const float* factor, int rank, int r) {
    const float* a = factor + static_cast<std::ptrdiff_t>(lower) * rank + r;
    return a[0] + fraction * (a[rank] - a[0]);
  };
  // [r, z] operands, so that the products run along z.
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
  const Layout at(s);
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
  const Layout at(s);
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
  const Layout at(f), into(t);
  // [slow, fast, rank], the slow axis first.
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
  const Layout at(s);
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
  const FactorMaps maps(s, target);
  LeafFactors factors = maps.read(parameters);
  fit_factors(target.b, factors);
  maps.write(factors, parameters);
}

}  // namespace tomofield::field
