#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "geometry/tilt_geometry.h"
#include "projection/sample_grid.h"

namespace tomofield::projection {

/// Computes line integrals of a sampled slab (16 detector rows) and their adjoint, after Joseph
/// (1982). Views up to 45° integrate along rows of z and steeper ones along columns of x, with
/// linear interpolation across, so that no view steps by more than √2 samples. Lengths are in
/// pixels. Forward and adjoint are exact transposes. Thread-safe.
class SlabProjector {
 public:
  /// The number of slabs that share the computation of a crossing. More slabs go in such groups.
  static constexpr int kSlabsTogether = 2;
  /// The crossings of a view's rays with the lines of a segment, which are rows of z for flat views
  /// and columns of x for steep ones. Pixel u crosses line l at sample
  /// offset + l offset_per_line + u step.
  struct Beam {
    bool flat = true;
    double offset = 0, offset_per_line = 0, step = 1;
    float weight = 0;   ///< length of the piece of ray that a line represents, in pixels
    double spread = 0;  ///< number of samples that this piece of ray spans
  };

  SlabProjector(const geometry::TiltGeometry& geometry, const SampleGrid& grid);

  const geometry::TiltGeometry& geometry() const { return geometry_; }
  const SampleGrid& grid() const { return grid_; }
  /// Returns the floats of the predicted rays of `num_views` views: [view, x, lane], and one more
  /// pixel, which is read.
  std::size_t detector_size(std::size_t num_views) const;

  /// Adds A samples to `detector` for the given views. Writes the padding of `samples`. With
  /// several slabs, their samples are consecutive (grid().size() floats each), and so are their
  /// detectors (detector_size(views.size()) floats each). Two slabs together take less time than
  /// one after the other.
  void forward(float* samples, std::span<const int> views, float* detector,
               int num_slabs = 1) const;
  /// Overwrites `samples` with Aᵀ detector, and the padding of the segments with 0.
  void backward(const float* detector, std::span<const int> views, float* samples,
                int num_slabs = 1) const;

 private:
  geometry::TiltGeometry geometry_;
  SampleGrid grid_;
  std::vector<std::vector<Beam>> beams_;  // [segment][view]
};

}  // namespace tomofield::projection
