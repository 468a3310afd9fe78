#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "objective/term.h"

namespace tomofield::objective {

/// A face is the part of a side that two neighbouring leaves share. It lies at x = `at` and goes
/// from y = `begin` to `end`, or at y = `at` and goes from x = `begin` to `end`. It spans the
/// thickness in z. Lengths are pixels.
struct Face {
  int low = 0, high = 0;  ///< leaves before and after the face
  bool faces_x = true;    ///< the normal is x, else y
  std::int64_t at = 0;
  std::int64_t begin = 0, end = 0;
  bool operator==(const Face&) const = default;
};

/// Returns all faces between two leaves of a tree. A side that meets several leaves has a face with
/// each of them.
std::vector<Face> shared_faces(const field::Quadtree& tree);

/// Sets the boundary consistency.
struct BoundaryOptions {
  double weight = 0.0;    ///< per px² of face and density unit; 0 is off
  double spacing = 8.0;   ///< side of the squares that get one random point each, px
  double epsilon = 1e-3;  ///< smooths the root where both sides agree, in density units
  std::uint64_t seed = 1;
};

/// Penalises differences between two leaves at their common face (eq. 6):
///
///   L = weight · Σ_faces A √(mean_p (f_low(p) − f_high(p))² + ε²) − A ε,
///
/// where A is the area of the face and p random points on it. This is the total variation of the
/// jump at the face, so the weight has the unit of that of total variation. Each step draws new
/// points, which depend on seed, step and face alone.
class BoundaryConsistency : public Term {
 public:
  /// Takes the faces between the leaves that are listed. `field` must outlive the term.
  BoundaryConsistency(const field::Field& field, std::span<const int> leaves,
                      const BoundaryOptions& options);

  /// Begins the work on some of those leaves. The value of a face counts for its lower leaf. A face
  /// between one of them and another leaf is evaluated too, so the other leaf may be given to
  /// another process.
  std::unique_ptr<LeafPass> leaf_pass(const Step& step, std::span<const int> leaves) const override;

 private:
  struct Samples;
  class Jumps;
  double face_gradient(std::size_t face, std::int64_t step, Samples& samples) const;
  void draw_points(std::size_t face, std::int64_t step, Samples& samples) const;
  std::vector<std::size_t> faces_of(std::span<const int> leaves) const;

  const field::Field& field_;
  BoundaryOptions options_;
  std::vector<Face> faces_;
  std::vector<std::vector<std::size_t>> faces_of_leaf_;  // ascending
};

}  // namespace tomofield::objective
