#include "objective/boundary_consistency.h"

#include <algorithm>
#include <cmath>
#include <iterator>

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

BoundaryConsistency::BoundaryConsistency(const field::Field& field, std::span<const int> leaves,
                                         const BoundaryOptions& options)
    : field_(field),
      options_(options),
      faces_of_leaf_(static_cast<std::size_t>(field.tree().num_leaves())) {
  std::vector<char> is_listed(faces_of_leaf_.size());
  for (const int leaf : leaves) is_listed[static_cast<std::size_t>(leaf)] = 1;
  for (const Face& face : shared_faces(field.tree())) {
    const auto low = static_cast<std::size_t>(face.low), high = static_cast<std::size_t>(face.high);
    if (!is_listed[low] || !is_listed[high]) continue;
    faces_of_leaf_[low].push_back(faces_.size());
    faces_of_leaf_[high].push_back(faces_.size());
    faces_.push_back(face);
  }
}

// Holds the points of a face, the densities of both leaves there, and the gradients by them.
struct BoundaryConsistency::Samples {
  std::vector<double> x, y, z;
  std::vector<float> low, high, grad_low, grad_high;
  double value = 0.0;

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

// Returns the faces of some leaves, ascending.
std::vector<std::size_t> BoundaryConsistency::faces_of(std::span<const int> leaves) const {
  std::vector<std::size_t> faces;
  for (const int leaf : leaves)
    std::ranges::copy(faces_of_leaf_[static_cast<std::size_t>(leaf)], std::back_inserter(faces));
  std::ranges::sort(faces);
  faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
  return faces;
}

// The jumps at the faces of some leaves. A reading evaluates a face.
class BoundaryConsistency::Jumps : public LeafPass {
 public:
  Jumps(const BoundaryConsistency& term, std::int64_t step, std::span<const int> leaves)
      : term_(term),
        step_(step),
        leaves_(leaves),
        faces_(term.faces_of(leaves)),
        samples_(faces_.size()) {}

  std::int64_t num_readings() const override { return std::ssize(faces_); }

  void read(std::int64_t index) override {
    const auto face = static_cast<std::size_t>(index);
    samples_[face].value = term_.face_gradient(faces_[face], step_, samples_[face]);
  }

  TermValue add_leaf(std::size_t index, float* gradient) override {
    const field::Field& field = term_.field_;
    const int leaf = leaves_[index];
    TermValue result;
    for (const std::size_t face : term_.faces_of_leaf_[static_cast<std::size_t>(leaf)]) {
      const auto at = std::ranges::lower_bound(faces_, face) - faces_.begin();
      const Samples& s = samples_[static_cast<std::size_t>(at)];
      const bool is_low = term_.faces_[face].low == leaf;
      if (is_low) result.value += s.value;
      result.grad_bias +=
          field.point_gradient(leaf, s.points(), is_low ? s.low : s.high,
                               is_low ? s.grad_low : s.grad_high, gradient + field.offset(leaf));
    }
    return result;
  }

 private:
  const BoundaryConsistency& term_;
  std::int64_t step_;
  std::span<const int> leaves_;
  std::vector<std::size_t> faces_;
  std::vector<Samples> samples_;  // one for each of faces_
};

std::unique_ptr<Term::LeafPass> BoundaryConsistency::leaf_pass(const Step& step,
                                                               std::span<const int> leaves) const {
  if (options_.weight <= 0) return nullptr;
  return std::make_unique<Jumps>(*this, step.number, leaves);
}

}  // namespace tomofield::objective
