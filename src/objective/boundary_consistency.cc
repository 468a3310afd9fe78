#include "objective/boundary_consistency.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace tomofield::objective {
namespace {

using field::Quadtree;
using field::Square;

// Random streams from here on draw the points.
constexpr std::uint64_t kPointStream = std::uint64_t{1} << 48;

// Adds the faces along one side of a leaf, one for each neighbour beyond it.
void add_side(const Quadtree& tree, int leaf, bool faces_x, std::vector<Face>& faces) {
  const Square& s = tree.leaf(leaf).square;
  const std::int64_t at = faces_x ? s.x1() : s.y1();
  const std::int64_t end = faces_x ? s.y1() : s.x1();
  for (std::int64_t along = faces_x ? s.y0 : s.x0; along < end;) {
    const double x = static_cast<double>(faces_x ? at : along) + field::kPixelCentre;
    const double y = static_cast<double>(faces_x ? along : at) + field::kPixelCentre;
    const int next = tree.find_leaf(x, y);
    if (next < 0) return;  // the domain is a rectangle: it ends along the whole side
    const Square& n = tree.leaf(next).square;
    const std::int64_t piece_end = std::min(end, faces_x ? n.y1() : n.x1());
    faces.push_back({leaf, next, faces_x, at, along, piece_end});
    along = piece_end;
  }
}

}  // namespace

std::vector<Face> shared_faces(const Quadtree& tree) {
  std::vector<Face> faces;
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf) {
    add_side(tree, leaf, true, faces);
    add_side(tree, leaf, false, faces);
  }
  return faces;
}

BoundaryConsistency::BoundaryConsistency(const field::Field& field,
                                         const std::vector<std::vector<int>>& leaves_of_band,
                                         const BoundaryOptions& options)
    : field_(field), options_(options), bands_(leaves_of_band.size()) {
  std::vector<int> band_of(static_cast<std::size_t>(field.tree().num_leaves()), -1);
  for (std::size_t b = 0; b < leaves_of_band.size(); ++b) {
    for (const int leaf : leaves_of_band[b])
      band_of[static_cast<std::size_t>(leaf)] = static_cast<int>(b);
  }
  for (const Face& face : shared_faces(field.tree())) {
    const int low = band_of[static_cast<std::size_t>(face.low)];
    const int high = band_of[static_cast<std::size_t>(face.high)];
    if (low < 0 || high < 0) continue;
    const std::size_t index = faces_.size();
    faces_.push_back(face);
    bands_[static_cast<std::size_t>(low)].push_back({index, true, high == low});
    if (high != low) bands_[static_cast<std::size_t>(high)].push_back({index, false, true});
  }
}

// Holds the points of a face, the densities of both leaves there, and the gradients by them.
struct BoundaryConsistency::Samples {
  std::vector<double> x, y, z;
  std::vector<float> low, high, grad_low, grad_high;

  field::Points points() const { return {x, y, z}; }
  void resize(std::size_t count) {
    for (auto* axis : {&x, &y, &z}) axis->resize(count);
    for (auto* values : {&low, &high, &grad_low, &grad_high}) values->resize(count);
  }
};

// Draws one point in each cell of a grid over the face.
void BoundaryConsistency::draw_points(std::size_t index, std::int64_t step,
                                      Samples& samples) const {
  const Face& face = faces_[index];
  const double length = static_cast<double>(face.end - face.begin);
  const auto cells = [&](double size) {
    return std::max<std::int64_t>(1, std::llround(size / options_.spacing));
  };
  const std::int64_t num_along = cells(length), num_z = cells(field_.thickness());
  samples.resize(static_cast<std::size_t>(num_along * num_z));
  base::Random random(options_.seed,
                      kPointStream + static_cast<std::uint64_t>(step) * faces_.size() + index);
  std::vector<double>& along = face.faces_x ? samples.y : samples.x;
  std::vector<double>& across = face.faces_x ? samples.x : samples.y;
  std::fill(across.begin(), across.end(), static_cast<double>(face.at) + field::kPixelCentre);
  std::size_t n = 0;
  for (std::int64_t i = 0; i < num_along; ++i) {
    for (std::int64_t k = 0; k < num_z; ++k, ++n) {
      const double cell_along = static_cast<double>(i) + random.uniform();
      const double cell_z = static_cast<double>(k) + random.uniform();
      along[n] = static_cast<double>(face.begin) + field::kPixelCentre +
                 cell_along * length / static_cast<double>(num_along);
      samples.z[n] = cell_z * field_.thickness() / static_cast<double>(num_z);
    }
  }
}

// Returns the loss of one face. Stores its derivatives by the densities of both leaves.
double BoundaryConsistency::face_gradient(std::size_t index, std::int64_t step, Samples& s) const {
  const Face& face = faces_[index];
  draw_points(index, step, s);
  field_.point_densities(face.low, s.points(), s.low);
  field_.point_densities(face.high, s.points(), s.high);
  double squares = 0.0;
  for (std::size_t n = 0; n < s.low.size(); ++n) {
    const double jump = static_cast<double>(s.low[n]) - static_cast<double>(s.high[n]);
    squares += jump * jump;
  }
  const double count = static_cast<double>(s.low.size());
  const double epsilon = options_.epsilon;
  const double root = std::sqrt(squares / count + epsilon * epsilon);
  const double area = static_cast<double>(face.end - face.begin) * field_.thickness();
  const float slope = static_cast<float>(options_.weight * area / (count * root));
  for (std::size_t n = 0; n < s.low.size(); ++n) {
    s.grad_low[n] = slope * (s.low[n] - s.high[n]);
    s.grad_high[n] = -s.grad_low[n];
  }
  return options_.weight * area * (root - epsilon);
}

TermValue BoundaryConsistency::add_gradient(int band, std::int64_t step, float* gradient) const {
  thread_local Samples s;
  TermValue result;
  if (options_.weight <= 0) return result;
  for (const FaceOfBand& owned : bands_[static_cast<std::size_t>(band)]) {
    const Face& face = faces_[owned.face];
    const double value = face_gradient(owned.face, step, s);
    if (owned.owns_low) {
      result.value += value;
      result.grad_bias += field_.point_gradient(face.low, s.points(), s.low, s.grad_low,
                                                gradient + field_.offset(face.low));
    }
    if (owned.owns_high) {
      result.grad_bias += field_.point_gradient(face.high, s.points(), s.high, s.grad_high,
                                                gradient + field_.offset(face.high));
    }
  }
  return result;
}

}  // namespace tomofield::objective
