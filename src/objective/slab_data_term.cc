#include "objective/slab_data_term.h"

#include <algorithm>
#include <vector>

#include "base/aligned_buffer.h"
#include "base/threads/parallel.h"
#include "kernels/lanes.h"

namespace tomofield::objective {

using kernels::kLanes;

// Holds the detectors of the slabs, one after another.
struct SlabDataTerm::Detectors : Scratch {
  base::AlignedBuffer<float> rays;
};

std::unique_ptr<Term::Scratch> SlabDataTerm::make_scratch(const projection::SlabSampler&) const {
  return std::make_unique<Detectors>();
}

// The back-projection replaces the gradient of the batch, which saves a pass that clears it. So
// this term has to come first (terms.cc).
double SlabDataTerm::add_slabs(const Step& step, const SlabBatch& batch, Scratch* scratch,
                               std::span<measurement::ViewSums> view_sums) const {
  const projection::SlabProjector& projector = batch.projector;
  const std::size_t detector_size = projector.detector_size(step.views.size());
  base::AlignedBuffer<float>& detector = static_cast<Detectors&>(*scratch).rays;
  detector.reserve(static_cast<std::size_t>(batch.slabs.size()) * detector_size);
  projector.fill_padding(batch.all_samples, batch.slabs.size());

  const std::vector<base::Range>& ranges = projector.pixel_ranges();
  std::vector<measurement::ViewSums> sums(ranges.size() * step.views.size());
  base::parallel_for("compare with views", std::ssize(ranges), [&](std::int64_t i) {
    const auto range = static_cast<std::size_t>(i);
    add_pixels(step, batch, ranges[range], detector.data(),
               std::span(sums).subspan(range * step.views.size(), step.views.size()));
  });
  for (std::size_t i = 0; i < sums.size(); ++i) view_sums[i % step.views.size()] += sums[i];
  for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab) measured_.release(slab);
  projector.backward(detector.data(), batch.crossings, batch.all_gradients, batch.slabs.size());
  return 0.0;
}

// Predicts some pixels of all views and replaces them by the derivatives of the loss. There is one
// element of `sums` for each view.
void SlabDataTerm::add_pixels(const Step& step, const SlabBatch& batch, base::Range pixels,
                              float* detector, std::span<measurement::ViewSums> sums) const {
  const std::int64_t width = batch.projector.geometry().width;
  const std::size_t detector_size = batch.projector.detector_size(step.views.size());
  const measurement::SlabViews& measured = step.surrogates ? step.surrogates->rays() : measured_;
  const auto rays_of = [&](int slab, std::size_t v) {
    return detector + static_cast<std::size_t>(slab - batch.slabs.begin) * detector_size +
           (static_cast<std::int64_t>(v) * width + pixels.begin) * kLanes;
  };
  for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab) {
    for (std::size_t v = 0; v < step.views.size(); ++v)
      std::fill_n(rays_of(slab, v), pixels.size() * kLanes, 0.0f);
  }
  batch.projector.forward_pixels(batch.all_samples, batch.crossings, pixels, detector,
                                 batch.slabs.size());
  for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab) {
    for (std::size_t v = 0; v < step.views.size(); ++v) {
      const int view = step.views[v];
      const int place = step.surrogates ? step.surrogates->place(view) : view;
      sums[v] += measurement::data_term(
          step.models[static_cast<std::size_t>(view)], step.multiplicity,
          measured.rays(slab, place) + pixels.begin * kLanes,
          measured.mask(slab, place) + pixels.begin, pixels.size(), rays_of(slab, v));
    }
  }
}

}  // namespace tomofield::objective
