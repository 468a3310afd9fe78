#pragma once

#include <cstddef>
#include <vector>

#include "geometry/tilt_geometry.h"

namespace tomofield::projection {

/// A part of a slab that is sampled on one regular grid in x and z: the region of interest with one
/// sample a pixel, or a coarser margin. Sample (i, k) is at X = x0 + (i + ½) hx, Z = (k + ½) hz, in
/// pixels.
///
/// A side is cut at its face if another segment continues there, so that each point of a ray
/// belongs to one segment. Otherwise the field ends there, and the density fades to nothing over
/// one sample.
struct SampleSegment {
  double x0 = 0, hx = 1, hz = 1;
  int nx = 0, nz = 0;
  bool cut_low = false, cut_high = false;
  std::ptrdiff_t origin = 0;  ///< position of sample (0, 0, lane 0) in a slab buffer, in floats

  /// Returns the floats from one z row to the next: the samples and at least one of padding on
  /// either side.
  std::ptrdiff_t stride_z() const;
  double x1() const { return x0 + nx * hx; }
};

/// The samples of a slab: [segment][z][x][lane] with one sample of padding around each segment.
/// Every slab of a reconstruction has the same layout.
class SampleGrid {
 public:
  explicit SampleGrid(std::vector<SampleSegment> segments);
  const std::vector<SampleSegment>& segments() const { return segments_; }
  /// Returns the size of a slab buffer in floats.
  std::size_t size() const { return size_; }

 private:
  std::vector<SampleSegment> segments_;
  std::size_t size_ = 0;
};

/// Makes a grid of the region of interest [x0, x1) with one sample a pixel. With `margin_spacing` >
/// 0 it also has margins on both sides as far as any ray reaches, sampled every `margin_spacing`
/// pixels.
SampleGrid make_sample_grid(const geometry::TiltGeometry& geometry, double x0, double x1,
                            double margin_spacing);
/// Makes such a grid for rays that reach from reach.low to reach.high.
SampleGrid make_sample_grid(const geometry::TiltGeometry::Extent& reach, double thickness,
                            double x0, double x1, double margin_spacing);

}  // namespace tomofield::projection
