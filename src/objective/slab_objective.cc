#include "objective/slab_objective.h"

#include <algorithm>
#include <utility>

#include "base/aligned_buffer.h"
#include "kernels/lanes.h"

namespace tomofield::objective {

using kernels::kLanes;
using projection::SampleSegment;

constexpr int kPair = projection::SlabProjector::kSlabsTogether;

// What a thread needs for a band; kept between calls. Slabs and detectors of a pair follow each
// other.
struct SlabObjective::Workspace {
  base::AlignedBuffer<float> samples, grad_samples, detector;
  base::AlignedBuffer<float> flux, row;

  void fit(std::size_t slab_size, std::size_t detector_size, std::size_t row_size) {
    // Padding has to start as zeros and stays so: a new layout needs new buffers.
    if (samples.size() != kPair * slab_size) {
      samples.reset(kPair * slab_size);
      grad_samples.reset(kPair * slab_size);
    }
    detector.reserve(kPair * detector_size);
    if (row.size() != row_size) {
      flux.reset(row_size);
      row.reset(row_size);
    }
  }
};

SlabObjective::SlabObjective(const projection::SlabSampler& sampler,
                             const projection::SlabProjector& projector,
                             const measurement::SlabViews& measured, const field::Field& field,
                             const ObjectiveWeights& weights)
    : sampler_(sampler),
      projector_(projector),
      measured_(measured),
      field_(field),
      weights_(weights) {}

BandResult SlabObjective::accumulate_gradient(int band_index, std::span<const int> views,
                                              std::span<const measurement::ViewModel> models,
                                              double multiplicity, float* gradient) const {
  thread_local Workspace w;
  w.fit(projector_.grid().size(), projector_.detector_size(views.size()), sampler_.row_size());
  const auto band = sampler_.band(band_index);
  BandResult result;
  result.views.resize(views.size());

  for (int slab = band.first; slab < band.end; slab += kPair) {
    const projection::SlabSampler::Range pair{slab, std::min(slab + kPair, band.end)};
    for_each_slab(pair, w, [&](int at, float* samples, float*) { sampler_.decode(at, samples); });
    if (slab == band.first) start_flux(slab, w);
    add_data_term(pair, views, models, multiplicity, w, result);
    if (pair.end < sampler_.num_slabs() && weights_.density_variation > 0)
      sampler_.decode_row(static_cast<std::int64_t>(pair.end) * kLanes, w.row.data());
    for_each_slab(pair, w, [&](int at, float* samples, float* grad_samples) {
      add_variation(at, pair, samples, grad_samples, w, result);
      result.grad_bias += sampler_.decode_adjoint(at, samples, grad_samples, gradient);
    });
  }
  if (weights_.factor_variation > 0) {
    for (const int leaf : sampler_.leaves_of_band(band_index)) {
      result.variation += field_.parameter_variation(
          leaf, weights_.factor_penalty, weights_.factor_variation, gradient + field_.offset(leaf));
    }
  }
  return result;
}

// body(slab, its samples, their gradient)
template <typename Body>
void SlabObjective::for_each_slab(const projection::SlabSampler::Range& pair, Workspace& w,
                                  const Body& body) const {
  std::size_t at = 0;
  for (int slab = pair.first; slab < pair.end; ++slab, at += projector_.grid().size())
    body(slab, w.samples.data() + at, w.grad_samples.data() + at);
}

// Its gradient takes the place of what was in `grad_samples`.
void SlabObjective::add_data_term(const projection::SlabSampler::Range& pair,
                                  std::span<const int> views,
                                  std::span<const measurement::ViewModel> models,
                                  double multiplicity, Workspace& w, BandResult& result) const {
  const std::int64_t width = projector_.geometry().width;
  const std::size_t detector_size = projector_.detector_size(views.size());
  const int count = pair.end - pair.first;
  std::fill_n(w.detector.data(), static_cast<std::size_t>(count) * detector_size, 0.0f);
  projector_.forward(w.samples.data(), views, w.detector.data(), count);
  float* detector = w.detector.data();
  for (int slab = pair.first; slab < pair.end; ++slab, detector += detector_size) {
    for (std::size_t v = 0; v < views.size(); ++v) {
      result.views[v] +=
          measurement::data_term(models[static_cast<std::size_t>(views[v])], multiplicity,
                                 measured_.rays(slab, views[v]), measured_.mask(slab, views[v]),
                                 width, detector + static_cast<std::ptrdiff_t>(v) * width * kLanes);
    }
    measured_.release(slab);
  }
  projector_.backward(w.detector.data(), views, w.grad_samples.data(), count);
}

kernels::SlabVariation SlabObjective::variation_of(std::size_t index) const {
  const SampleSegment& segment = projector_.grid().segments()[index];
  kernels::SlabVariation variation;
  variation.nx = segment.nx;
  variation.nz = segment.nz;
  variation.stride_z = segment.stride_z();
  variation.per_hx = static_cast<float>(1.0 / segment.hx);
  variation.per_hz = static_cast<float>(1.0 / segment.hz);
  variation.weight = static_cast<float>(weights_.density_variation * segment.hx * segment.hz);
  variation.penalty = weights_.density_penalty;
  variation.backward_x = weights_.backward_x;
  variation.backward_z = weights_.backward_z;
  return variation;
}

void SlabObjective::add_variation(int slab, const projection::SlabSampler::Range& pair,
                                  const float* samples, float* grad_samples, Workspace& w,
                                  BandResult& result) const {
  if (weights_.density_variation <= 0) return;
  for (std::size_t s = 0; s < projector_.grid().segments().size(); ++s) {
    const std::ptrdiff_t origin = projector_.grid().segments()[s].origin;
    kernels::SlabVariation variation = variation_of(s);
    variation.samples = samples + origin;
    variation.gradient = grad_samples + origin;
    variation.num_rows = sampler_.rows_in_slab(slab);
    variation.above = row_above(slab, pair, s, w);
    variation.flux = w.flux.data() + sampler_.row_origin(s);
    result.variation += kernels::slab_variation(variation);
  }
}

// The flux from the band before into the first row of this one.
void SlabObjective::start_flux(int slab, Workspace& w) const {
  w.flux.fill(0.0f);
  if (slab == 0 || weights_.density_variation <= 0) return;
  sampler_.decode_row(static_cast<std::int64_t>(slab) * kLanes - 1, w.row.data());
  for (std::size_t s = 0; s < projector_.grid().segments().size(); ++s) {
    kernels::row_flux(variation_of(s), decoded_row(w, s), first_row(w.samples.data(), s),
                      w.flux.data() + sampler_.row_origin(s));
  }
}

// The first row past a slab of a pair; none past the last slab of all.
kernels::DensityRow SlabObjective::row_above(int slab, const projection::SlabSampler::Range& pair,
                                             std::size_t segment, const Workspace& w) const {
  if (slab + 1 == sampler_.num_slabs()) return {};
  if (slab + 1 == pair.end) return decoded_row(w, segment);
  const auto next = static_cast<std::size_t>(slab + 1 - pair.first);
  return first_row(w.samples.data() + next * projector_.grid().size(), segment);
}

// The first row of a slab, where it lies among the others.
kernels::DensityRow SlabObjective::first_row(const float* samples, std::size_t segment) const {
  const SampleSegment& s = projector_.grid().segments()[segment];
  return {samples + s.origin, kLanes, s.stride_z()};
}

// The row that was decoded by itself.
kernels::DensityRow SlabObjective::decoded_row(const Workspace& w, std::size_t segment) const {
  return {w.row.data() + sampler_.row_origin(segment), projector_.grid().segments()[segment].nz, 1};
}

}  // namespace tomofield::objective
