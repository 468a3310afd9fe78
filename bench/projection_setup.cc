#include "bench/projection_setup.h"

#include <cmath>

#include "base/random.h"
#include "kernels/lanes.h"

namespace tomofield::bench {
namespace {

constexpr int kWidth = 256;

// Counts the samples that the detector pixels of the views take. This is less than the nominal
// voxels × views, because some rays miss the specimen and steep rays cross a column less often than
// once a voxel.
double updates_done(const geometry::TiltGeometry& g, const std::vector<int>& views) {
  double count = 0.0;
  for (const int view : views) {
    const bool flat = g.is_flat(view);
    const int num_lines = flat ? static_cast<int>(g.thickness) : kWidth;
    const double limit = flat ? kWidth : g.thickness;
    for (int line = 0; line < num_lines; ++line) {
      for (int u = 0; u < kWidth; ++u) {
        const double at =
            flat ? g.ray_x(view, u + 0.5, line + 0.5) : g.ray_z(view, u + 0.5, line + 0.5);
        if (at >= -0.5 && at < limit + 0.5) count += kernels::kLanes;
      }
    }
  }
  return count;
}

void fill_randomly(base::AlignedBuffer<float>& values, std::uint64_t seed) {
  base::Random random(seed);
  for (float& v : values) v = static_cast<float>(random.uniform(-1.0, 1.0));
}

}  // namespace

geometry::TiltGeometry yardstick_geometry(int thickness) {
  std::vector<double> tilts;
  for (int view = 0; view < 94; ++view) tilts.push_back(-70.0 + 1.5 * view);
  return geometry::centred_geometry(kWidth, kWidth, thickness, tilts);
}

ProjectionSetup::ProjectionSetup(int thickness, int stride, int num_slabs)
    : num_slabs_(num_slabs),
      geometry_(yardstick_geometry(thickness)),
      grid_(projection::make_sample_grid(geometry_, 0, kWidth, 0)),
      projector_(geometry_, grid_) {
  for (int v = 0; v < geometry_.num_views(); v += stride) views_.push_back(v);
  const auto count = static_cast<std::size_t>(num_slabs);
  samples_.reset(count * grid_.size());
  gradient_.reset(count * grid_.size());
  detector_.reset(count * projector_.detector_size(views_.size()));
  fill_randomly(samples_, 1);
  fill_randomly(detector_, 2);
}

Case ProjectionSetup::work(const std::string& name) const {
  Case c;
  c.name = name;
  c.updates = num_slabs_ * kWidth * kernels::kLanes * geometry_.thickness *
              static_cast<double>(views_.size());
  c.done = num_slabs_ * updates_done(geometry_, views_);
  c.flops = 4 * c.done;
  c.bytes = 8 * c.done;
  return c;
}

Case ProjectionSetup::forward_case(const std::string& name,
                                   std::shared_ptr<ProjectionSetup> self) const {
  Case c = work(name);
  c.run = [self] {
    self->detector_.fill(0.0f);
    self->projector_.forward(self->samples_.data(), self->views_, self->detector_.data(),
                             self->num_slabs_);
  };
  return c;
}

Case ProjectionSetup::adjoint_case(const std::string& name,
                                   std::shared_ptr<ProjectionSetup> self) const {
  Case c = work(name);
  c.run = [self] {
    self->projector_.backward(self->detector_.data(), self->views_, self->gradient_.data(),
                              self->num_slabs_);
  };
  return c;
}

}  // namespace tomofield::bench
