#include "simulate/view_warp.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace tomofield::simulate {
namespace {

using Weights = std::array<double, ViewWarp::kNodes>;

// Returns the weights of the nodes at a position along one side, from −1/2 to 1/2 of its length.
Weights node_weights(double position) {
  constexpr int kLast = ViewWarp::kNodes - 1;
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

}  // namespace

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

}  // namespace tomofield::simulate
