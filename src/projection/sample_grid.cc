#include "projection/sample_grid.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/lanes.h"

namespace tomofield::projection {

// Returns an odd multiple of eight cache lines, so that neighbouring rows and the samples of a
// column spread over all sets of a cache.
std::ptrdiff_t SampleSegment::stride_z() const {
  const int padded = (nx + 2 + 7) / 16 * 16 + 8;
  return static_cast<std::ptrdiff_t>(padded) * kernels::kLanes;
}

SampleGrid::SampleGrid(std::vector<SampleSegment> segments) : segments_(std::move(segments)) {
  std::ptrdiff_t end = 0;
  for (SampleSegment& s : segments_) {
    s.origin = end + s.stride_z() + kernels::kLanes;
    end += s.stride_z() * (s.nz + 2);
  }
  // One vector is added, because the total variation reads a float past the last sample.
  size_ = static_cast<std::size_t>(end + kernels::kLanes);
}

SampleGrid make_sample_grid(const geometry::TiltGeometry& geometry, double x0, double x1,
                            double margin_spacing) {
  return make_sample_grid(geometry.reach(), geometry.thickness, x0, x1, margin_spacing);
}

SampleGrid make_sample_grid(const geometry::TiltGeometry::Extent& reach, double thickness,
                            double x0, double x1, double margin_spacing) {
  const auto segment = [&](double from, double width, double spacing) {
    SampleSegment s;
    s.x0 = from;
    s.nx = static_cast<int>(std::lround(width / spacing));
    s.hx = spacing;
    s.nz = std::max(1, static_cast<int>(std::ceil(thickness / spacing)));
    s.hz = thickness / s.nz;
    return s;
  };
  std::vector<SampleSegment> segments{segment(x0, x1 - x0, 1.0)};
  if (margin_spacing <= 0) return SampleGrid(std::move(segments));

  const double low = std::ceil(std::max(0.0, x0 - reach.low) / margin_spacing) * margin_spacing;
  const double high = std::ceil(std::max(0.0, reach.high - x1) / margin_spacing) * margin_spacing;
  if (low > 0) {
    segments.front().cut_low = true;
    segments.push_back(segment(x0 - low, low, margin_spacing));
    segments.back().cut_high = true;
  }
  if (high > 0) {
    segments.front().cut_high = true;
    segments.push_back(segment(x1, high, margin_spacing));
    segments.back().cut_low = true;
  }
  return SampleGrid(std::move(segments));
}

}  // namespace tomofield::projection
