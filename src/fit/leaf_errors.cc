#include "fit/leaf_errors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/parallel.h"
#include "base/random.h"

namespace tomofield::fit {
namespace {

constexpr int kBoxesX = 8, kBoxesY = 8, kBoxesZ = 16;

// A stream for each square and pass; splitmix in Random mixes the bits.
base::Random random_of(const field::Square& square, std::uint64_t seed, std::uint64_t pass) {
  std::uint64_t stream = pass;
  for (const std::int64_t part : {square.x0, square.y0, square.size})
    stream = base::Random(stream, static_cast<std::uint64_t>(part)).bits();
  return base::Random(seed, stream);
}

double deviation(const field::Field& field, const field::Square& square, base::Random random) {
  const double width = static_cast<double>(square.size);
  double sum = 0.0, squares = 0.0;
  for (int k = 0; k < kBoxesZ; ++k) {
    for (int j = 0; j < kBoxesY; ++j) {
      for (int i = 0; i < kBoxesX; ++i) {
        const double x = field::kPixelCentre + static_cast<double>(square.x0) +
                         width * (i + random.uniform()) / kBoxesX;
        const double y = field::kPixelCentre + static_cast<double>(square.y0) +
                         width * (j + random.uniform()) / kBoxesY;
        const double z = field.thickness() * (k + random.uniform()) / kBoxesZ;
        const double density = field.density(x, y, z);
        sum += density;
        squares += density * density;
      }
    }
  }
  constexpr double kPoints = kBoxesX * kBoxesY * kBoxesZ;
  const double mean = sum / kPoints;
  return std::sqrt(std::max(squares / kPoints - mean * mean, 0.0));
}

}  // namespace

std::vector<double> leaf_errors(const field::Field& field, std::uint64_t seed, std::uint64_t pass) {
  const field::Quadtree& tree = field.tree();
  std::vector<double> errors(static_cast<std::size_t>(tree.num_leaves()));
  base::parallel_for(tree.num_leaves(), [&](std::int64_t i) {
    const field::QuadtreeNode& leaf = tree.leaf(static_cast<int>(i));
    if (leaf.region != field::Region::kInterest) return;
    errors[static_cast<std::size_t>(i)] =
        deviation(field, leaf.square, random_of(leaf.square, seed, pass));
  });
  return errors;
}

}  // namespace tomofield::fit
