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

double activate(const kernels::Activation& activation, double a) {
  const double beta = static_cast<double>(activation.beta);
  if (beta <= 0) return a;
  return std::max(a, 0.0) + std::log1p(std::exp(-beta * std::abs(a))) / beta;
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

double Field::vertex_y(int leaf, double y) const {
  const Square& square = tree_.leaf(leaf).square;
  return (y - static_cast<double>(square.y0)) / static_cast<double>(square.size) *
         (shape(leaf).ny - 1);
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

double Field::density(double x, double y, double z) const {
  const int leaf = tree_.find_leaf(x, y);
  if (leaf < 0 || !(z >= 0 && z <= thickness_)) return 0.0;
  const Square& square = tree_.leaf(leaf).square;
  const LeafShape& s = shape(leaf);
  const double vx =
      (x - static_cast<double>(square.x0)) / static_cast<double>(square.size) * (s.nx - 1);
  const double vz = z / thickness_ * (s.nz - 1);
  return activate(activation,
                  point_value(leaf, vx, vertex_y(leaf, y), vz) + static_cast<double>(bias));
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
