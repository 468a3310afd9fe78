#pragma once

#include <cstddef>
#include <vector>

#include "geometry/tilt_geometry.h"

namespace tomofield::projection {

/// A part of a slab that is sampled on one regular grid in x and z: the region
/// of interest at one pixel, the margins coarser. Sample (i, k) sits at
/// X = x0 + (i + ½) hx, Z = (k + ½) hz.
///
/// A side either `cuts` at its face, where another segment goes on, so that each
/// point of a ray belongs to one segment; or fades over one sample to nothing,
/// where the field ends.
struct SampleSegment {
  double x0 = 0, hx = 1, hz = 1;
  int nx = 0, nz = 0;
  bool cut_low = false, cut_high = false;
  std::ptrdiff_t origin = 0;  ///< of sample (0, 0, lane 0) in a slab buffer

  /// Floats between z rows: one sample of padding on either side, or more.
  std::ptrdiff_t stride_z() const;
  double x1() const { return x0 + nx * hx; }
};

/// The samples of a slab: [segment][z][x][lane] with one sample of padding
/// around each segment. Every slab of a reconstruction has the same layout.
class SampleGrid {
 public:
  explicit SampleGrid(std::vector<SampleSegment> segments);
  const std::vector<SampleSegment>& segments() const { return segments_; }
  /// Floats of a slab buffer.
  std::size_t size() const { return size_; }

 private:
  std::vector<SampleSegment> segments_;
  std::size_t size_ = 0;
};

/// The region of interest [x0, x1) at one sample a pixel, and, with
/// `margin_spacing` > 0, the margins on both sides as far as any ray reaches,
/// sampled every `margin_spacing` pixels.
SampleGrid make_sample_grid(const geometry::TiltGeometry& geometry, double x0, double x1,
                            double margin_spacing);
/// The same for rays that reach from reach.low to reach.high.
SampleGrid make_sample_grid(const geometry::TiltGeometry::Extent& reach, double thickness,
                            double x0, double x1, double margin_spacing);

}  // namespace tomofield::projection
