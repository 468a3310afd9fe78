#include "field/field.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/check.h"
#include "field/grid_field.h"
#include "field/resample.h"
#include "field/vm_field.h"
#include "tomofield/error.h"

namespace tomofield::field {
namespace {

// One axis of points between n vertices from `low` on over `length`; kept between calls.
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
  // Every leaf starts on a cache line: leaves are updated by different threads.
  constexpr std::size_t kAlignment = 16;
  offsets_.assign(1, 0);
  for (const LeafShape& s : shapes_) {
    offsets_.push_back((offsets_.back() + parameter_count(s) + kAlignment - 1) / kAlignment *
                       kAlignment);
  }
  parameters_.reset(offsets_.back());
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

void Field::split_leaf(int leaf) {
  const int node = tree_.leaves()[static_cast<std::size_t>(leaf)];
  const LeafShape parent_shape = shape(leaf);
  const std::vector<int> old_leaves = tree_.leaves();
  const std::vector<LeafShape> old_shapes = shapes_;
  const std::vector<std::size_t> old_offsets = offsets_;
  const base::AlignedBuffer<float> old_parameters = std::move(parameters_);

  tree_.split(leaf);
  const auto old_leaf = [&](int n) {
    return static_cast<std::size_t>(std::find(old_leaves.begin(), old_leaves.end(), n) -
                                    old_leaves.begin());
  };
  shapes_.clear();
  for (const int n : tree_.leaves()) {
    const bool is_child = tree_.nodes()[static_cast<std::size_t>(n)].parent == node;
    shapes_.push_back(is_child ? parent_shape : old_shapes[old_leaf(n)]);
  }
  allocate();
  for (int i = 0; i < tree_.num_leaves(); ++i) {
    const int n = tree_.leaves()[static_cast<std::size_t>(i)];
    float* to = parameters_.data() + offset(i);
    if (tree_.leaf(i).parent == node) {
      const int quarter = n - tree_.nodes()[static_cast<std::size_t>(node)].first_child;
      sample_quarter(parent_shape,
                     old_parameters.data() + old_offsets[static_cast<std::size_t>(leaf)],
                     0.5 * (quarter & 1), 0.5 * (quarter >> 1), to);
    } else {
      const std::size_t from = old_offsets[old_leaf(n)];
      std::copy_n(old_parameters.data() + from, parameter_count(shape(i)), to);
    }
  }
}

double vertex_height(double thickness) { return std::max(1.0, thickness - 1.0); }

std::size_t count_parameters(const std::string& kind, const std::vector<LeafShape>& shapes) {
  std::size_t count = 0;
  for (const LeafShape& shape : shapes) {
    count += kind == "vm" ? VmField::count(shape) : GridField::count(shape);
  }
  return count;
}

std::unique_ptr<Field> make_field(const std::string& kind, Quadtree tree, double thickness,
                                  std::vector<LeafShape> shapes) {
  if (kind == "vm") return std::make_unique<VmField>(std::move(tree), thickness, std::move(shapes));
  if (kind == "grid")
    return std::make_unique<GridField>(std::move(tree), thickness, std::move(shapes));
  throw Error(fmt::format("there is no field '{}': take vm or grid", kind));
}

}  // namespace tomofield::field
