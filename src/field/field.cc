#include "field/field.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/check.h"
#include "base/threads/parallel.h"
#include "field/grid/grid_field.h"
#include "field/merge_target.h"
#include "field/sampling/resample.h"
#include "field/vm/vm_field.h"
#include "tomofield/error.h"

namespace tomofield::field {
namespace {

// Places points between n vertices of one axis, from `low` on over `length`. The arrays stay
// allocated between calls.
kernels::AxisTaps axis_taps(std::span<const double> positions, double low, double length, int n,
                            int axis) {
  thread_local std::vector<int> lower[3];
  thread_local std::vector<float> fraction[3];
  lower[axis].resize(positions.size());
  fraction[axis].resize(positions.size());
  const double vertices_a_pixel = (n - 1) / length;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const AxisPoint at((positions[i] - low) * vertices_a_pixel, n);
    lower[axis][i] = static_cast<int>(at.lower);
    fraction[axis][i] = static_cast<float>(at.fraction);
  }
  return {static_cast<int>(positions.size()), lower[axis].data(), fraction[axis].data()};
}

}  // namespace

Field::Field(Quadtree tree, double thickness, std::vector<LeafShape> shapes)
    : tree_(std::move(tree)), thickness_(thickness), shapes_(std::move(shapes)) {
  TOMOFIELD_CHECK(static_cast<int>(shapes_.size()) == tree_.num_leaves(), "one shape a leaf");
  for (const LeafShape& s : shapes_)
    TOMOFIELD_CHECK(s.nx >= 2 && s.ny >= 2 && s.nz >= 2, "a leaf needs two vertices an axis");
}

void Field::allocate() {
  // Every leaf starts on a cache line, because different threads update different leaves.
  constexpr std::size_t kAlignment = 16;
  offsets_.assign(1, 0);
  for (const LeafShape& s : shapes_) {
    offsets_.push_back((offsets_.back() + parameter_count(s) + kAlignment - 1) / kAlignment *
                       kAlignment);
  }
  parameters_.reset(offsets_.back());
}

void Field::initialise(base::Random random, double scale) {
  // Every parameter takes one number of the sequence, whichever leaves are kept.
  base::parallel_for("initialise leaves", tree_.num_leaves(), [&](std::int64_t i) {
    const int leaf = static_cast<int>(i);
    if (!keeps(leaf)) return;
    base::Random of_leaf = random;
    of_leaf.skip(offset(leaf));
    for (std::size_t at = offset(leaf); at < offset(leaf + 1); ++at)
      parameters_[at] = static_cast<float>(of_leaf.uniform(-scale, scale));
  });
}

void Field::keep_only(const std::vector<int>& leaves) {
  is_kept_.assign(leaves.empty() ? 0 : static_cast<std::size_t>(tree_.num_leaves()), 0);
  for (const int leaf : leaves) is_kept_[static_cast<std::size_t>(leaf)] = 1;
}

double Field::vertex_x(int leaf, double x) const {
  const Square& square = tree_.leaf(leaf).square;
  return (x - kPixelCentre - static_cast<double>(square.x0)) / static_cast<double>(square.size) *
         (shape(leaf).nx - 1);
}

double Field::vertex_y(int leaf, double y) const {
  const Square& square = tree_.leaf(leaf).square;
  return (y - kPixelCentre - static_cast<double>(square.y0)) / static_cast<double>(square.size) *
         (shape(leaf).ny - 1);
}

double Field::vertex_z(int leaf, double z) const {
  return (z - kPixelCentre) / vertex_height(thickness_) * (shape(leaf).nz - 1);
}

LaneRows Field::lane_rows(int leaf, std::span<const double, kernels::kLanes> y) const {
  LaneRows rows;
  for (std::size_t l = 0; l < y.size(); ++l) {
    const AxisPoint at(vertex_y(leaf, y[l]), shape(leaf).ny);
    rows.lower[l] = static_cast<int>(at.lower);
    rows.fraction[l] = static_cast<float>(at.fraction);
  }
  return rows;
}

bool LaneRows::are_a_vertex_apart() const {
  for (int l = 1; l < kernels::kLanes; ++l)
    if (lower[static_cast<std::size_t>(l)] != lower[0] + l) return false;
  return true;
}

bool LaneRows::are_at_neighbouring_vertices() const {
  return are_a_vertex_apart() && std::ranges::count(fraction, 0.0f) == kernels::kLanes;
}

std::vector<ParameterRuns> Field::parameters_between(int leaf, double low, double high) const {
  const int n = shape(leaf).ny;
  const auto first = AxisPoint(vertex_y(leaf, low), n).lower;
  const auto last = AxisPoint(vertex_y(leaf, high), n).lower + 1;
  return runs_of_rows(shape(leaf), static_cast<int>(first), static_cast<int>(last) + 1);
}

void Field::slab_values(int leaf, const LaneRows& rows, float* values) const {
  std::fill_n(values, shape(leaf).vertices_xz() * kernels::kLanes, bias);
  add_slab_values(leaf, rows, values);
}

void Field::row_values(int leaf, double y, float* values) const {
  std::fill_n(values, shape(leaf).vertices_xz(), bias);
  const AxisPoint at(vertex_y(leaf, y), shape(leaf).ny);
  add_row_values(leaf, static_cast<int>(at.lower), static_cast<float>(at.fraction), values);
}

PointTaps Field::point_taps(int leaf, const Points& points) const {
  const Square& square = tree_.leaf(leaf).square;
  const LeafShape& s = shape(leaf);
  const double size = static_cast<double>(square.size);
  return {axis_taps(points.x, static_cast<double>(square.x0) + kPixelCentre, size, s.nx, 0),
          axis_taps(points.y, static_cast<double>(square.y0) + kPixelCentre, size, s.ny, 1),
          axis_taps(points.z, kPixelCentre, vertex_height(thickness_), s.nz, 2)};
}

void Field::point_densities(int leaf, const Points& points, std::span<float> densities) const {
  std::fill(densities.begin(), densities.end(), bias);
  add_point_values(leaf, point_taps(leaf, points), densities.data());
  kernels::activate(activation, densities.data(), std::ssize(densities));
}

double Field::point_gradient(int leaf, const Points& points, std::span<const float> densities,
                             std::span<const float> grad_densities, float* gradient) const {
  thread_local std::vector<float> grad_values;
  grad_values.assign(grad_densities.begin(), grad_densities.end());
  double grad_bias = 0.0;
  for (std::size_t i = 0; i < grad_values.size(); ++i) {
    if (activation.beta > 0) grad_values[i] *= -std::expm1(-activation.beta * densities[i]);
    grad_bias += static_cast<double>(grad_values[i]);
  }
  add_point_gradient(leaf, point_taps(leaf, points), grad_values.data(), gradient);
  return grad_bias;
}

double Field::density(double x, double y, double z) const {
  const int leaf = tree_.find_leaf(x, y);
  if (leaf < 0 || !(z >= 0 && z <= thickness_)) return 0.0;
  float density = 0.0f;
  point_densities(leaf, {{&x, 1}, {&y, 1}, {&z, 1}}, {&density, 1});
  return static_cast<double>(density);
}

// Carries a leaf's values from an array of this field to one leaf of the edited field.
void Field::carry_leaf(const LeafOrigin& origin, const float* from, float* to) const {
  const LeafShape& s = shape(origin.leaf);
  const float* leaf = from + offset(origin.leaf);
  switch (origin.kind) {
    case LeafOrigin::Kind::kSame:
      std::copy_n(leaf, parameter_count(s), to);
      break;
    case LeafOrigin::Kind::kQuarter:
      sample_quarter(s, leaf, 0.5 * (origin.quarter & 1), 0.5 * (origin.quarter >> 1), to);
      break;
    case LeafOrigin::Kind::kUnion:
      join_leaves(s,
                  {leaf, from + offset(origin.leaf + 1), from + offset(origin.leaf + 2),
                   from + offset(origin.leaf + 3)},
                  to);
      break;
  }
}

std::vector<LeafOrigin> Field::edit(const QuadtreeEdit& edit,
                                    const std::vector<base::AlignedBuffer<float>*>& moments) {
  EditedTree edited = edit_tree(tree_, edit);
  std::vector<LeafShape> shapes;
  for (const LeafOrigin& origin : edited.origins) {
    shapes.push_back(shape(origin.leaf));
    for (int c = 1; c < 4 && origin.kind == LeafOrigin::Kind::kUnion; ++c)
      TOMOFIELD_CHECK(shape(origin.leaf + c) == shapes.back(), "merged leaves have one shape");
  }
  const auto after = make_field(kind(), std::move(edited.tree), thickness_, std::move(shapes));
  std::vector<base::AlignedBuffer<float>> carried;
  for (std::size_t i = 0; i < moments.size(); ++i) carried.emplace_back(after->num_parameters());
  base::parallel_for("edit leaves", after->tree().num_leaves(), [&](std::int64_t i) {
    const LeafOrigin& origin = edited.origins[static_cast<std::size_t>(i)];
    const std::size_t at = after->offset(static_cast<int>(i));
    float* parameters = after->parameters_.data() + at;
    carry_leaf(origin, parameters_.data(), parameters);
    if (origin.kind == LeafOrigin::Kind::kUnion)
      fit_merged(shape(origin.leaf), make_merge_target(*this, origin.leaf), parameters);
    for (std::size_t k = 0; k < moments.size(); ++k)
      carry_leaf(origin, moments[k]->data(), carried[k].data() + at);
  });
  for (std::size_t k = 0; k < moments.size(); ++k) *moments[k] = std::move(carried[k]);
  tree_ = std::move(after->tree_);
  shapes_ = std::move(after->shapes_);
  offsets_ = std::move(after->offsets_);
  parameters_ = std::move(after->parameters_);
  return std::move(edited.origins);
}

std::unique_ptr<Field> Field::resampled(std::vector<LeafShape> shapes) const {
  auto after = make_field(kind(), tree_, thickness_, std::move(shapes));
  after->bias = bias;
  after->activation = activation;
  after->is_kept_ = is_kept_;
  base::parallel_for("resample leaves", tree_.num_leaves(), [&](std::int64_t i) {
    const int leaf = static_cast<int>(i);
    if (!keeps(leaf)) return;
    const LeafShape &from = shape(leaf), &to = after->shape(leaf);
    TOMOFIELD_CHECK(
        from.rank_x == to.rank_x && from.rank_y == to.rank_y && from.rank_z == to.rank_z,
        "new vertices, not ranks");
    resample_leaf(from, leaf_parameters(leaf), to, after->parameters_.data() + after->offset(leaf));
  });
  return after;
}

double vertex_height(double thickness) { return std::max(1.0, thickness - 1.0); }

std::size_t count_parameters(FieldKind kind, const std::vector<LeafShape>& shapes) {
  std::size_t count = 0;
  for (const LeafShape& shape : shapes) {
    count += kind == FieldKind::kVm ? VmField::count(shape) : GridField::count(shape);
  }
  return count;
}

std::unique_ptr<Field> make_field(FieldKind kind, Quadtree tree, double thickness,
                                  std::vector<LeafShape> shapes) {
  if (kind == FieldKind::kVm)
    return std::make_unique<VmField>(std::move(tree), thickness, std::move(shapes));
  return std::make_unique<GridField>(std::move(tree), thickness, std::move(shapes));
}

}  // namespace tomofield::field
