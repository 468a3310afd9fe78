#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/range.h"
#include "geometry/tilt_geometry.h"
#include "projection/sample_grid.h"
#include "projection/view_crossings.h"

namespace tomofield::projection {

/// Computes line integrals of sampled slabs (16 detector rows each) and their adjoint, after Joseph
/// (1982). Views up to 45° integrate along rows of z and steeper ones along columns of x, with
/// linear interpolation across, so that no view steps by more than √2 samples. Lengths are in
/// pixels. Forward and adjoint are exact transposes.
///
/// Samples of several slabs are consecutive, grid().size() floats each. So are their detectors,
/// [view, x, lane] of a list of views, detector_size() floats each. Functions work on all threads,
/// by ranges of pixels or samples, and can be called from several.
class SlabProjector {
 public:
  /// The number of slabs that share the computation of a crossing. More slabs go in such groups.
  static constexpr int kSlabsTogether = 2;

  SlabProjector(const geometry::TiltGeometry& geometry, const SampleGrid& grid);

  const geometry::TiltGeometry& geometry() const { return geometry_; }
  const SampleGrid& grid() const { return grid_; }
  /// Returns the floats of the predicted rays of `num_views` views: [view, x, lane], and one more
  /// pixel, which is read.
  std::size_t detector_size(std::size_t num_views) const;
  /// Returns where the rays of some views cross the samples, for the functions below.
  ViewCrossings crossings(std::span<const int> views) const { return {geometry_, grid_, views}; }

  /// Adds A samples to `detector`. Writes the padding of `samples`.
  void forward(float* samples, const ViewCrossings& crossings, float* detector,
               int num_slabs = 1) const;
  void forward(float* samples, std::span<const int> views, float* detector,
               int num_slabs = 1) const {
    forward(samples, crossings(views), detector, num_slabs);
  }
  /// Overwrites `samples` with Aᵀ detector, and the padding of the segments with 0.
  void backward(const float* detector, const ViewCrossings& crossings, float* samples,
                int num_slabs = 1) const;
  void backward(const float* detector, std::span<const int> views, float* samples,
                int num_slabs = 1) const {
    backward(detector, crossings(views), samples, num_slabs);
  }

  /// Returns ranges of pixels that take similar time, for forward_pixels(). They do not depend on
  /// the number of threads.
  const std::vector<base::Range>& pixel_ranges() const { return pixel_ranges_; }
  /// Writes the padding of samples that forward_pixels() reads.
  void fill_padding(float* samples, int num_slabs) const;
  /// Does the part of forward() that belongs to some pixels, after fill_padding().
  void forward_pixels(const float* samples, const ViewCrossings& crossings, base::Range pixels,
                      float* detector, int num_slabs) const;

 private:
  // Samples [begin, end) along x of a segment, for all z.
  struct SamplesOfSegment {
    std::size_t segment;
    base::Range x;
  };
  void backward_samples(const float* detector, const ViewCrossings& crossings,
                        const SamplesOfSegment& part, float* samples, int num_slabs) const;

  geometry::TiltGeometry geometry_;
  SampleGrid grid_;
  std::vector<base::Range> pixel_ranges_;
  std::vector<SamplesOfSegment> sample_ranges_;
};

}  // namespace tomofield::projection
