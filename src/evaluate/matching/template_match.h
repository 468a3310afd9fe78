#pragma once

#include <array>
#include <complex>
#include <vector>

#include "base/volume.h"
#include "field/sampling/sample_box.h"

namespace tomofield::evaluate {

/// A local maximum of the correlation, in voxels: voxel i covers [i, i + 1).
struct Pick {
  std::array<double, 3> position_px{};
  float correlation = 0.0f;
};

/// Returns rotations that cover all orientations evenly: super-Fibonacci spirals (Alexa, CVPR 2022,
/// 8291). `count` of 96 are about 50° apart.
std::vector<field::Rotation> even_rotations(int count);

/// Correlates volumes with a particle in many orientations.
class TemplateMatcher {
 public:
  /// Takes the volume that is searched, high = dense, and prepares it for particles that lie within
  /// `radius_px` of their centre. Throws Error for an axis not longer than 2 radius + 1 voxels.
  TemplateMatcher(const base::Volume& volume, double radius_px);

  /// Returns for each voxel the largest correlation of the reference with the voxels around it over
  /// the rotations, [z, y, x]. It is Pearson's correlation within a sphere of `radius_px` (Roseman,
  /// Ultramicroscopy 94, 225, 2003). The reference is a cube of an even side in the same voxels,
  /// with the particle's origin in its centre, and linear between voxels. The volume counts as
  /// periodic, so voxels nearer to a face than the radius have no meaning. Throws Error for a
  /// reference that is constant within the sphere.
  base::Volume correlate(const base::Volume& reference,
                         const std::vector<field::Rotation>& rotations) const;

 private:
  using Spectrum = std::vector<std::complex<float>>;
  void add_template(const base::Volume& reference, const field::Rotation& rotation,
                    std::complex<float> factor, Spectrum& sum) const;

  base::Shape3 shape_;
  double voxel_size_A_;
  double radius_px_;
  Spectrum spectrum_;             // of the volume
  std::vector<float> deviation_;  // of the voxels within the sphere around each voxel
};

/// Returns the maxima of a correlation from the highest down, each at least `distance_px` from all
/// higher ones, and only as far as `margin_px` from the faces; at most `most`.
std::vector<Pick> find_picks(const base::Volume& correlation, double distance_px, double margin_px,
                             std::size_t most);

}  // namespace tomofield::evaluate
