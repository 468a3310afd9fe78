#include "objective/slab_data_term.h"

#include <algorithm>

#include "base/aligned_buffer.h"
#include "kernels/lanes.h"

namespace tomofield::objective {

// The back-projection replaces the gradient of the batch, which saves a pass that clears it. So
// this term has to come first (terms.cc).
double SlabDataTerm::add_slabs(const Step& step, const SlabBatch& batch,
                               std::span<measurement::ViewSums> view_sums) const {
  thread_local base::AlignedBuffer<float> detector;  // one slab after another
  const std::int64_t width = batch.projector.geometry().width;
  const std::size_t detector_size = batch.projector.detector_size(step.views.size());
  const std::size_t size = static_cast<std::size_t>(batch.size()) * detector_size;
  detector.reserve(size);
  std::fill_n(detector.data(), size, 0.0f);
  batch.projector.forward(batch.all_samples, step.views, detector.data(), batch.size());
  float* rays = detector.data();
  for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab, rays += detector_size) {
    for (std::size_t v = 0; v < step.views.size(); ++v) {
      const int view = step.views[v];
      view_sums[v] +=
          measurement::data_term(step.models[static_cast<std::size_t>(view)], step.multiplicity,
                                 measured_.rays(slab, view), measured_.mask(slab, view), width,
                                 rays + static_cast<std::ptrdiff_t>(v) * width * kernels::kLanes);
    }
    measured_.release(slab);
  }
  batch.projector.backward(detector.data(), step.views, batch.all_gradients, batch.size());
  return 0.0;
}

}  // namespace tomofield::objective
