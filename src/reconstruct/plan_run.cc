
#include <algorithm>
#include <utility>

#include "base/lanes.h"
#include "base/memory.h"
#include "base/parallel.h"
#include "reconstruct/domain.h"
#include "reconstruct/fit.h"
#include "reconstruct/reconstruct.h"

namespace tomofield::reconstruct {
namespace {

// Parameters, gradient and two moments; the rays in their slab order (large
// series lie in a file that the kernel pages and count only as far as it is
// kept); and what each thread works on.
std::size_t estimate_memory(const PreparedSeries& plan, const Domain& domain,
                            std::size_t num_parameters, int num_views) {
  constexpr std::size_t kFixed = std::size_t{48} << 20;  // program and libraries
  const std::size_t width = static_cast<std::size_t>(plan.geometry.width);
  const std::size_t rows = static_cast<std::size_t>(plan.roi.height());
  const std::size_t parameters = 4 * sizeof(float) * num_parameters;
  const std::size_t rays = static_cast<std::size_t>(num_views) * width * rows * (sizeof(float) + 1);
  const std::size_t slab = 3 * domain.grid.size() * sizeof(float);
  const std::size_t detector =
      static_cast<std::size_t>(num_views) * width * base::kLanes * sizeof(float);
  std::size_t leaf = 0;
  for (const field::LeafShape& shape : domain.shapes) {
    leaf = std::max(leaf, 2 * shape.vertices_xz() * base::kLanes * sizeof(float));
  }
  return kFixed + parameters + rays +
         static_cast<std::size_t>(base::thread_count()) * (slab + detector + leaf);
}

}  // namespace

RunPlan plan_run(const tilt_series::TiltSeries& series, const ReconstructOptions& options) {
  const PreparedSeries plan = plan_series(series, options.specimen);
  const Domain domain = make_domain(plan.geometry, plan.roi, options.field);
  RunPlan run;
  run.num_views = plan.geometry.num_views();
  run.view_width = plan.geometry.width;
  run.view_height = plan.geometry.height;
  run.pixel_size_A = plan.pixel_size_A;
  run.roi = plan.roi;
  run.thickness = plan.geometry.thickness;
  run.num_leaves = domain.tree.num_leaves();
  run.num_parameters = field::count_parameters(options.field.kind, domain.shapes);
  run.num_steps =
      static_cast<std::int64_t>(options.fit.epochs) * std::min(options.fit.subsets, run.num_views);
  run.memory_bytes = estimate_memory(plan, domain, run.num_parameters, run.num_views);
  base::require_memory(run.memory_bytes, "this reconstruction",
                       "use a larger --bin or --vertex-spacing, a smaller --roi or --thickness, or "
                       "fewer --threads");
  return run;
}

}  // namespace tomofield::reconstruct
