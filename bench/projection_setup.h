#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/aligned_buffer.h"
#include "bench/measure.h"
#include "geometry/tilt_geometry.h"
#include "projection/slab_projector.h"

namespace tomofield::bench {

/// Holds `num_slabs` slabs of 256 × 16 × thickness voxels, every `stride`-th of the 94 views of
/// yardstick A, and the buffers to project the slabs in these views.
class ProjectionSetup {
 public:
  ProjectionSetup(int thickness, int stride, int num_slabs);

  Case forward_case(const std::string& name, std::shared_ptr<ProjectionSetup> self) const;
  Case adjoint_case(const std::string& name, std::shared_ptr<ProjectionSetup> self) const;

  const geometry::TiltGeometry& geometry() const { return geometry_; }
  const std::vector<int>& views() const { return views_; }
  const projection::SampleGrid& grid() const { return grid_; }

 private:
  Case work(const std::string& name) const;

  int num_slabs_;
  geometry::TiltGeometry geometry_;
  projection::SampleGrid grid_;
  projection::SlabProjector projector_;
  std::vector<int> views_;
  base::AlignedBuffer<float> samples_, gradient_, detector_;
};

/// Returns the geometry of yardstick A: 256 × 256 pixels, 94 views from −70° to 69.5°.
geometry::TiltGeometry yardstick_geometry(int thickness);

}  // namespace tomofield::bench
