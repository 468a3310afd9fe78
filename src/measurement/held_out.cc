#include "measurement/held_out.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/aligned_buffer.h"
#include "base/log.h"
#include "base/threads/parallel.h"
#include "geometry/tilt_geometry.h"
#include "kernels/lanes.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

using kernels::kLanes;

// Computes line integrals of slabs. Each thread keeps its buffers from one slab to the next.
class Predictor {
 public:
  Predictor(const projection::SlabSampler& sampler, const projection::SlabProjector& projector,
            std::span<const int> views)
      : sampler_(sampler),
        projector_(projector),
        crossings_(projector.crossings(views)),
        buffers_(static_cast<std::size_t>(base::thread_count())) {}

  // Returns [view, x, lane], valid until this thread asks for another slab.
  float* rays_of(int slab) {
    Buffers& b = buffers_[static_cast<std::size_t>(base::thread_index())];
    b.samples.reserve(projector_.grid().size());
    b.rays.reserve(projector_.detector_size(crossings_.num_views()));
    b.rays.fill(0.0f);
    sampler_.decode(slab, b.samples.data());
    projector_.forward(b.samples.data(), crossings_, b.rays.data());
    return b.rays.data();
  }

 private:
  struct Buffers {
    base::AlignedBuffer<float> samples, rays;
  };
  const projection::SlabSampler& sampler_;
  const projection::SlabProjector& projector_;
  projection::ViewCrossings crossings_;  // of all slabs
  std::vector<Buffers> buffers_;
};

SlabSums sums_of_slabs(const projection::SlabSampler& sampler,
                       const projection::SlabProjector& projector, const SlabViews& measured,
                       std::span<const int> views, const distributed::Communicator& processes) {
  const std::int64_t width = projector.geometry().width;
  const auto num_slabs = static_cast<std::size_t>(measured.num_slabs());
  std::vector<ViewSums> all(num_slabs * views.size());
  Predictor predictor(sampler, projector, views);
  base::parallel_for("predict held-out views", measured.own().size(), [&](std::int64_t s) {
    const int slab = measured.own().begin + static_cast<int>(s);
    float* rays = predictor.rays_of(slab);
    for (std::size_t v = 0; v < views.size(); ++v) {
      all[static_cast<std::size_t>(slab) * views.size() + v] =
          data_term({}, 1.0, measured.rays(slab, views[v]), measured.mask(slab, views[v]), width,
                    rays + static_cast<std::ptrdiff_t>(v) * width * kLanes);
    }
    measured.release(slab);
  });
  allreduce_sum(processes, all);
  SlabSums sums(num_slabs);
  for (std::size_t s = 0; s < num_slabs; ++s) {
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(s * views.size());
    sums[s].assign(first, first + std::ssize(views));
  }
  return sums;
}

// Copies the rows of a slab to a view; `rays` [x, lane] are the predicted ones.
void copy_slab(const SlabViews& measured, int slab, int view, const ViewModel& model,
               const float* rays, PredictedView& into) {
  const std::int64_t rows = std::min<std::int64_t>(kLanes, into.height - slab * kLanes);
  for (std::int64_t lane = 0; lane < rows; ++lane) {
    for (std::int64_t x = 0; x < into.width; ++x) {
      const std::int64_t y = slab * kLanes + lane;
      const auto at = static_cast<std::size_t>(y * into.width + x);
      const double p = static_cast<double>(rays[x * kLanes + lane]);
      into.predicted[at] = static_cast<float>(model.scale * p + model.offset);
      into.measured[at] = measured.counts(view, x, y) ? measured.ray(view, x, y)
                                                      : std::numeric_limits<float>::quiet_NaN();
    }
  }
}

}  // namespace

std::vector<int> held_out_views(const std::vector<double>& tilt_deg, int every) {
  if (every == 0) return {};
  const std::vector<std::size_t> by_tilt = geometry::order_of_tilts(tilt_deg);
  const std::size_t step = static_cast<std::size_t>(every);
  std::vector<int> views;
  for (std::size_t i = step / 2; i + 1 < by_tilt.size(); i += step)
    views.push_back(static_cast<int>(by_tilt[i]));
  if (views.empty()) {
    throw Error(
        fmt::format("--hold-out {} holds out none of {} views: the first and the last in order of "
                    "tilt are always fitted, so give a smaller number, at least 2",
                    every, tilt_deg.size()));
  }
  std::ranges::sort(views);
  return views;
}

ViewErrors held_out_error(const projection::SlabSampler& sampler,
                          const projection::SlabProjector& projector, const SlabViews& measured,
                          std::vector<int> views, std::span<const double> noise_weight,
                          bool fit_view_scale, const distributed::Communicator& processes) {
  const SlabSums sums = sums_of_slabs(sampler, projector, measured, views, processes);
  return view_errors(std::move(views), sums, noise_weight, fit_view_scale);
}

std::vector<PredictedView> predicted_views(const projection::SlabSampler& sampler,
                                           const projection::SlabProjector& projector,
                                           const SlabViews& measured, std::span<const int> views,
                                           std::span<const ViewModel> models,
                                           const distributed::Communicator& processes) {
  const auto& shape = measured.shape();
  const auto size = static_cast<std::size_t>(shape.width * shape.num_rows);
  std::vector<PredictedView> results(views.size(), {.width = shape.width,
                                                    .height = shape.num_rows,
                                                    .measured = std::vector<float>(size),
                                                    .predicted = std::vector<float>(size)});
  Predictor predictor(sampler, projector, views);
  base::parallel_for("predict views", measured.own().size(), [&](std::int64_t s) {
    const int slab = measured.own().begin + static_cast<int>(s);
    const float* rays = predictor.rays_of(slab);
    for (std::size_t v = 0; v < views.size(); ++v, rays += shape.width * kLanes)
      copy_slab(measured, slab, views[v], models[v], rays, results[v]);
    measured.release(slab);
  });
  for (PredictedView& view : results) {
    processes.allreduce_sum(std::span(view.measured));
    processes.allreduce_sum(std::span(view.predicted));
  }
  return results;
}

}  // namespace tomofield::measurement
