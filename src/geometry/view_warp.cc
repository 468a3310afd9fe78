#include "geometry/view_warp.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace tomofield::geometry {
namespace {

// Calls visit(x, y) for 32 × 32 places that cover a warp's view evenly.
template <typename Visit>
void for_each_place(const ViewWarp& warp, const Visit& visit) {
  constexpr int kPlaces = 32;
  for (int row = 0; row < kPlaces; ++row) {
    for (int column = 0; column < kPlaces; ++column)
      visit(((column + 0.5) / kPlaces - 0.5) * warp.width_px,
            ((row + 0.5) / kPlaces - 0.5) * warp.height_px);
  }
}

}  // namespace

ViewWarp::Weights ViewWarp::node_weights(double position) {
  constexpr int kLast = kNodes - 1;
  const double at = std::clamp((position + 0.5) * kLast, 0.0, static_cast<double>(kLast));
  const int cell = std::min(static_cast<int>(at), kLast - 1);
  const double f = at - cell;
  Weights weights{};
  const auto add_slope = [&](int node, double weight) {
    const int before = std::max(node - 1, 0), after = std::min(node + 1, kLast);
    weights[static_cast<std::size_t>(after)] += weight / (after - before);
    weights[static_cast<std::size_t>(before)] -= weight / (after - before);
  };
  const auto first = static_cast<std::size_t>(cell);
  weights[first] += (1.0 + 2.0 * f) * (1.0 - f) * (1.0 - f);
  weights[first + 1] += f * f * (3.0 - 2.0 * f);
  add_slope(cell, f * (1.0 - f) * (1.0 - f));
  add_slope(cell + 1, f * f * (f - 1.0));
  return weights;
}

ViewWarp::Rows ViewWarp::rows() const {
  Rows result;
  for (std::size_t node = 0; node < nodes.size(); ++node)
    result[node / kNodes][node % kNodes] = nodes[node];
  return result;
}

ViewWarp ViewWarp::from_rows(double width_px, double height_px, const Rows& rows) {
  ViewWarp warp{.width_px = width_px, .height_px = height_px};
  for (std::size_t node = 0; node < warp.nodes.size(); ++node)
    warp.nodes[node] = rows[node / kNodes][node % kNodes];
  return warp;
}

ViewWarp::Vector ViewWarp::displacement(double x, double y) const {
  const Weights across = node_weights(x / width_px), along = node_weights(y / height_px);
  Vector sum{};
  for (std::size_t row = 0; row < along.size(); ++row) {
    for (std::size_t column = 0; column < across.size(); ++column) {
      const Vector& node = nodes[row * across.size() + column];
      const double weight = along[row] * across[column];
      for (std::size_t axis = 0; axis < 2; ++axis) sum[axis] += weight * node[axis];
    }
  }
  return sum;
}

double ViewWarp::largest_component() const {
  // Along one side the weights of the values are at most 1 together. Those of the two slopes are at
  // most 1/4 together, and a slope is at most twice the largest value: 3/2, squared for two sides.
  constexpr double kMost = 2.25;
  double largest = 0.0;
  for (const Vector& node : nodes)
    largest = std::max({largest, std::abs(node[0]), std::abs(node[1])});
  return kMost * largest;
}

ViewWarp::Vector ViewWarp::source_of(double x, double y) const {
  // The displacements differ by little from place to place, so that this converges.
  constexpr double kNear_px = 1e-4;
  constexpr int kMostSteps = 30;
  Vector source{x, y};
  for (int step = 0; step < kMostSteps; ++step) {
    const Vector d = displacement(source[0], source[1]);
    const Vector next{x - d[0], y - d[1]};
    const double change = std::max(std::abs(next[0] - source[0]), std::abs(next[1] - source[1]));
    source = next;
    if (change < kNear_px) break;
  }
  return source;
}

ViewWarp ViewWarp::then(const ViewWarp& next) const {
  ViewWarp both = *this;
  for (int row = 0; row < kNodes; ++row) {
    for (int column = 0; column < kNodes; ++column) {
      const Vector place = node_place(row, column);
      Vector& node = both.nodes[static_cast<std::size_t>(row * kNodes + column)];
      const Vector added = next.displacement(place[0] + node[0], place[1] + node[1]);
      node = {node[0] + added[0], node[1] + added[1]};
    }
  }
  return both;
}

ViewWarp ViewWarp::binned(double factor) const {
  ViewWarp result = *this;
  result.width_px /= factor;
  result.height_px /= factor;
  for (Vector& node : result.nodes) node = {node[0] / factor, node[1] / factor};
  return result;
}

double ViewWarp::mean_square() const {
  double squares = 0.0, count = 0.0;
  for_each_place(*this, [&](double x, double y) {
    const Vector d = displacement(x, y);
    squares += d[0] * d[0] + d[1] * d[1];
    count += 1.0;
  });
  return squares / count;
}

// The places lie evenly about the centre, so that the three parts are orthogonal.
ViewWarp::Rigid ViewWarp::rigid_part() const {
  Rigid part;
  double count = 0.0, squares = 0.0;
  for_each_place(*this, [&](double x, double y) {
    const Vector d = displacement(x, y);
    part.shift[0] += d[0];
    part.shift[1] += d[1];
    part.magnification += d[0] * x + d[1] * y;
    part.rotation += d[1] * x - d[0] * y;
    count += 1.0;
    squares += x * x + y * y;
  });
  part.shift = {part.shift[0] / count, part.shift[1] / count};
  part.magnification /= squares;
  part.rotation /= squares;
  return part;
}

// The splines have slopes that follow linear functions exactly, so it is enough to subtract at the
// nodes.
ViewWarp ViewWarp::without(const Rigid& part) const {
  ViewWarp rest = *this;
  for (int row = 0; row < kNodes; ++row) {
    for (int column = 0; column < kNodes; ++column) {
      const auto [x, y] = node_place(row, column);
      Vector& node = rest.nodes[static_cast<std::size_t>(row * kNodes + column)];
      node[0] -= part.shift[0] + part.magnification * x - part.rotation * y;
      node[1] -= part.shift[1] + part.magnification * y + part.rotation * x;
    }
  }
  return rest;
}

}  // namespace tomofield::geometry
