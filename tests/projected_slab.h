#pragma once

#include <numeric>
#include <vector>

#include "geometry/tilt_geometry.h"
#include "kernels/lanes.h"
#include "projection/slab_projector.h"

namespace tomofield::testing {

/// Holds angles where splatting projectors ripple, and both sides of the change from rows to
/// columns.
inline const std::vector<double> kProjectorAngles = {0,     26.57, 44.99,  45,  45.01,  63.43, 70,
                                                     71.57, 80,    -26.57, -45, -63.43, -80};

/// Returns the indices of all views.
inline std::vector<int> all_views(const geometry::TiltGeometry& g) {
  std::vector<int> views(static_cast<std::size_t>(g.num_views()));
  std::iota(views.begin(), views.end(), 0);
  return views;
}

/// Calls visit(index into a slab buffer, segment, x sample, z sample, lane) for each sample.
template <typename Visit>
void for_each_sample(const projection::SampleGrid& grid, Visit&& visit) {
  for (const projection::SampleSegment& s : grid.segments()) {
    for (int k = 0; k < s.nz; ++k) {
      for (int i = 0; i < s.nx; ++i) {
        for (int l = 0; l < kernels::kLanes; ++l) {
          visit(static_cast<std::size_t>(s.origin + k * s.stride_z() + i * kernels::kLanes + l), s,
                i, k, l);
        }
      }
    }
  }
}

/// Projects the samples of a slab to all views. Returns the detector [view, pixel, lane].
inline std::vector<float> project_slab(const geometry::TiltGeometry& g,
                                       const projection::SampleGrid& grid,
                                       std::vector<float> samples) {
  const projection::SlabProjector projector(g, grid);
  const auto views = all_views(g);
  std::vector<float> detector(projector.detector_size(views.size()));
  projector.forward(samples.data(), views, detector.data());
  return detector;
}

}  // namespace tomofield::testing
