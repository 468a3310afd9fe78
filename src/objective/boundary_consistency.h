#pragma once

#include <cstdint>
#include <vector>

#include "objective/term.h"

namespace tomofield::objective {

/// What two neighbouring leaves share of a side: `along` runs over y for a face
/// x = at, and over x for a face y = at; all of the thickness in z.
struct Face {
  int low = 0, high = 0;  ///< leaves before and after the face
  bool faces_x = true;    ///< the normal is x, else y
  std::int64_t at = 0;
  std::int64_t begin = 0, end = 0;  ///< along the face, in pixels
  bool operator==(const Face&) const = default;
};

/// Every face between two leaves of a tree, of equal or different levels and
/// regions; a side that meets several leaves has a face with each.
std::vector<Face> shared_faces(const field::Quadtree& tree);

struct BoundaryOptions {
  double weight = 0.0;    ///< per px² of face and density unit; 0 is off
  double spacing = 8.0;   ///< px: one random point in each square of this side
  double epsilon = 1e-3;  ///< density units; smooths the root where both sides agree
  std::uint64_t seed = 1;
};

/// Boundary consistency (eq. 6): the root mean square over random points of a
/// face of what its two leaves disagree by, summed over faces by their area A,
///
///   L = weight · Σ_faces A √(mean_p (f_low(p) − f_high(p))² + ε²) − A ε,
///
/// which is the total variation of a jump there, so its weight has the same
/// units as total variation's. Points are new in every step and depend on seed,
/// step and face alone.
class BoundaryConsistency : public Term {
 public:
  /// Faces between leaves that are listed; leaves_of_band[b] are those that band b owns.
  BoundaryConsistency(const field::Field& field,
                      const std::vector<std::vector<int>>& leaves_of_band,
                      const BoundaryOptions& options);

  /// Adds the gradient of the band's own leaves to `gradient` (all parameters). The value counts
  /// the faces whose lower leaf is the band's. A face between two bands is evaluated by both, so
  /// bands may run on any thread.
  TermValue add_gradient(int band, std::int64_t step, float* gradient) const;
  TermValue add_band(const Step& step, int band, float* gradient) const override {
    return add_gradient(band, step.number, gradient);
  }

 private:
  struct FaceOfBand {
    std::size_t face;
    bool owns_low, owns_high;
  };
  struct Samples;
  double face_gradient(std::size_t face, std::int64_t step, Samples& samples) const;
  void draw_points(std::size_t face, std::int64_t step, Samples& samples) const;

  const field::Field& field_;
  BoundaryOptions options_;
  std::vector<Face> faces_;
  std::vector<std::vector<FaceOfBand>> bands_;
};

}  // namespace tomofield::objective
