#include "compact/vertex_densities.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/check.h"
#include "base/range.h"
#include "kernels/leaf_decoding.h"

namespace tomofield::compact {
namespace {

using field::LeafShape;
using field::Square;

// Returns the smallest side that a leaf can be halved to.
std::int64_t smallest_side_in(const Square& square, const LeafShape& shape) {
  std::int64_t side = square.size;
  for (int steps = std::min(shape.nx, shape.ny) - 1;
       side % (2 * kernels::kLanes) == 0 && steps % 2 == 0 && shape.nx == shape.ny; steps /= 2)
    side /= 2;
  return side;
}

double spacing_of(const Square& square, int vertices) {
  return static_cast<double>(square.size) / (vertices - 1);
}

// Returns how many of n vertices along an axis, the first one at `begin`, are below `end`.
int count_below(std::int64_t begin, double spacing, int n, std::int64_t end) {
  const double count = std::ceil(static_cast<double>(end - begin) / spacing);
  return static_cast<int>(std::clamp(count, 0.0, static_cast<double>(n)));
}

// Holds the vertices along one axis of a square: those inside the region of interest, and those
// that its voxels use, which are their neighbours as well.
struct VerticesOfAxis {
  base::Range inside, used;
  VerticesOfAxis(std::int64_t begin, double spacing, int n, std::int64_t low, std::int64_t high)
      : inside{count_below(begin, spacing, n, low), count_below(begin, spacing, n, high)},
        used{std::max(inside.begin - 1, 0), std::min(inside.end + 1, n)} {}
};

}  // namespace

double PlaceDensities::volume() const {
  return volume_of_vertex * static_cast<double>(inside_x.size()) * inside_y.size() * nz;
}

std::array<double, 2> PlaceDensities::integrals() const {
  std::array<double, 2> sums{};
  for (int z = 0; z < nz; ++z) {
    const auto inside = values.block(inside_x.begin, Eigen::Index{z} * ny + inside_y.begin,
                                     inside_x.size(), inside_y.size());
    sums[0] += inside.cast<double>().sum();
    sums[1] += inside.cast<double>().squaredNorm();
  }
  return {sums[0] * volume_of_vertex, sums[1] * volume_of_vertex};
}

VertexDensities::VertexDensities(const field::Field& vertices, const Rectangle& roi)
    : vertices_(vertices), roi_(roi) {
  TOMOFIELD_CHECK(vertices.kind() == FieldKind::kGrid,
                  "plain vertices, which are their own values");
  smallest_side_ = vertices.tree().roots().cell_size;
  for (int leaf = 0; leaf < vertices.tree().num_leaves(); ++leaf) {
    smallest_side_ = std::min(
        smallest_side_, smallest_side_in(vertices.tree().leaf(leaf).square, vertices.shape(leaf)));
  }
}

// Leaves are at least a slab wide and lie at multiples of it, so points a slab apart meet them all.
std::vector<int> VertexDensities::leaves_near(const Square& square, std::int64_t reach) const {
  const auto positions = [&](std::int64_t low, std::int64_t high) {
    std::vector<double> at;
    for (std::int64_t i = low + kernels::kLanes / 2; i < high; i += kernels::kLanes)
      at.push_back(static_cast<double>(i));
    if (reach > 0) {
      at.push_back(static_cast<double>(low - reach));
      at.push_back(static_cast<double>(high + reach));
    }
    return at;
  };
  std::set<int> found;
  for (const double y : positions(square.y0, square.y1())) {
    for (const double x : positions(square.x0, square.x1()))
      found.insert(vertices_.tree().find_leaf(x, y));
  }
  return {found.begin(), found.end()};
}

bool VertexDensities::are_alike(int leaf, int other) const {
  if (leaf < 0 || other < 0) return false;
  const field::QuadtreeNode &a = vertices_.tree().leaf(leaf), &b = vertices_.tree().leaf(other);
  const LeafShape &of_a = vertices_.shape(leaf), &of_b = vertices_.shape(other);
  return a.region == b.region && of_a.nz == of_b.nz &&
         spacing_of(a.square, of_a.nx) == spacing_of(b.square, of_b.nx) &&
         spacing_of(a.square, of_a.ny) == spacing_of(b.square, of_b.ny);
}

int VertexDensities::leaf_like(const Square& square) const {
  const std::vector<int> leaves = leaves_near(square, 0);
  const bool all =
      std::ranges::all_of(leaves, [&](int leaf) { return are_alike(leaves.front(), leaf); });
  return all ? leaves.front() : -1;
}

bool VertexDensities::is_outside(const Square& square) const {
  if (square.x0 >= roi_.x1 || square.x1() <= roi_.x0 || square.y0 >= roi_.y1 ||
      square.y1() <= roi_.y0)
    return true;
  const std::vector<int> leaves = leaves_near(square, 0);
  return leaves.size() == 1 && leaves.front() < 0;
}

PlaceDensities VertexDensities::read(const Square& square) const {
  const int like = leaf_like(square);
  TOMOFIELD_CHECK(like >= 0, "leaves of one spacing");
  const Square& own = vertices_.tree().leaf(like).square;
  const LeafShape& shape = vertices_.shape(like);
  const double hx = spacing_of(own, shape.nx), hy = spacing_of(own, shape.ny);
  const auto steps = [](double length, double spacing) {
    return static_cast<int>(std::lround(length / spacing));
  };
  PlaceDensities place;
  const auto side = static_cast<double>(square.size);
  place.nx = steps(side, hx);
  place.ny = steps(side, hy);
  place.nz = shape.nz;
  place.values.setZero(place.nx, Eigen::Index{place.nz} * place.ny);
  place.volume_of_vertex =
      side * side * vertices_.thickness() / static_cast<double>(place.values.size());
  const VerticesOfAxis along_x(square.x0, hx, place.nx, roi_.x0, roi_.x1);
  const VerticesOfAxis along_y(square.y0, hy, place.ny, roi_.y0, roi_.y1);
  place.inside_x = along_x.inside;
  place.inside_y = along_y.inside;
  Eigen::MatrixXi count = Eigen::MatrixXi::Zero(place.nx, place.ny);
  std::vector<float> line;
  for (const int leaf : leaves_near(square, 1)) {
    if (!are_alike(like, leaf)) continue;
    const Square& from = vertices_.tree().leaf(leaf).square;
    const LeafShape& s = vertices_.shape(leaf);
    const int dx = steps(static_cast<double>(from.x0 - square.x0), hx);
    const int dy = steps(static_cast<double>(from.y0 - square.y0), hy);
    const int x0 = std::max(along_x.used.begin, dx), x1 = std::min(along_x.used.end, dx + s.nx);
    const int y0 = std::max(along_y.used.begin, dy), y1 = std::min(along_y.used.end, dy + s.ny);
    if (x0 >= x1 || y0 >= y1) continue;
    const float* values = vertices_.parameters().data() + vertices_.offset(leaf);
    line.resize(static_cast<std::size_t>(y1 - y0));
    for (int x = x0; x < x1; ++x) {
      for (int z = 0; z < s.nz; ++z) {
        const float* row = values + (std::ptrdiff_t{x - dx} * s.nz + z) * s.ny - dy;
        std::transform(row + y0, row + y1, line.begin(),
                       [&](float value) { return value + vertices_.bias; });
        kernels::activate(vertices_.activation, line.data(), std::ssize(line));
        for (int y = y0; y < y1; ++y)
          place.values(x, Eigen::Index{z} * place.ny + y) += line[static_cast<std::size_t>(y - y0)];
      }
      for (int y = y0; y < y1; ++y) ++count(x, y);
    }
  }
  for (int x = 0; x < place.nx; ++x) {
    for (int y = 0; y < place.ny; ++y) {
      if (count(x, y) < 2) continue;
      for (int z = 0; z < place.nz; ++z)
        place.values(x, Eigen::Index{z} * place.ny + y) /= static_cast<float>(count(x, y));
    }
  }
  return place;
}

}  // namespace tomofield::compact
