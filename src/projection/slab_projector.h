#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "geometry/tilt_geometry.h"
#include "projection/sample_grid.h"

namespace tomofield::projection {

/// Line integrals of a sampled slab (16 detector rows) and their adjoint, after
/// Joseph (1982): views up to 45° integrate along rows of z, steeper ones along
/// columns of x, with linear interpolation across, so that no view steps by
/// more than √2 samples. Lengths are in pixels. Forward and adjoint are exact
/// transposes. Thread-safe.
class SlabProjector {
 public:
  /// Slabs that share the work of a crossing; of more, so many at a time do.
  static constexpr int kSlabsTogether = 2;
  /// How the rays of a view cross the lines of a segment, which are rows of z
  /// for flat views and columns of x for steep ones: pixel u crosses line l at
  /// sample offset + l offset_per_line + u step.
  struct Beam {
    bool flat = true;
    double offset = 0, offset_per_line = 0, step = 1;
    float weight = 0;   ///< length of ray that a line stands for
    double spread = 0;  ///< how many samples that piece of ray spans
  };

  SlabProjector(const geometry::TiltGeometry& geometry, const SampleGrid& grid);

  const geometry::TiltGeometry& geometry() const { return geometry_; }
  const SampleGrid& grid() const { return grid_; }
  /// Floats of the predicted rays of `num_views` views: [view, x, lane], and one pixel more,
  /// which is read.
  std::size_t detector_size(std::size_t num_views) const;

  /// detector += A samples for the named views. Writes the padding of `samples`. Of several
  /// slabs, samples follow each other (grid().size() floats), and so do detectors
  /// (detector_size(views.size())); two together take less time than one after the other.
  void forward(float* samples, std::span<const int> views, float* detector,
               int num_slabs = 1) const;
  /// samples ← Aᵀ detector, and 0 in the padding of the segments.
  void backward(const float* detector, std::span<const int> views, float* samples,
                int num_slabs = 1) const;

 private:
  geometry::TiltGeometry geometry_;
  SampleGrid grid_;
  std::vector<std::vector<Beam>> beams_;  // [segment][view]
};

}  // namespace tomofield::projection
