#include "reconstruct/slab_objective.h"

#include <algorithm>
#include <utility>

#include "base/aligned_buffer.h"
#include "kernels/lanes.h"

namespace tomofield::reconstruct {

using kernels::kLanes;
using projection::SampleSegment;

// What a thread needs for a band; kept between calls.
struct SlabObjective::Workspace {
  base::AlignedBuffer<float> samples, next_samples, grad_samples, detector;
  base::AlignedBuffer<float> flux, row, next_row;

  void fit(std::size_t slab_size, std::size_t detector_size, std::size_t row_size) {
    // Padding has to start as zeros and stays so: a new layout needs new buffers.
    if (samples.size() != slab_size) {
      samples.reset(slab_size);
      next_samples.reset(slab_size);
      grad_samples.reset(slab_size);
    }
    detector.reserve(detector_size);
    if (row.size() != row_size) {
      flux.reset(row_size);
      row.reset(row_size);
      next_row.reset(row_size);
    }
  }
};

SlabObjective::SlabObjective(const projection::SlabSampler& sampler,
                             const projection::SlabProjector& projector,
                             const tilt_series::SlabViews& measured, const field::Field& field,
                             const ObjectiveWeights& weights)
    : sampler_(sampler),
      projector_(projector),
      measured_(measured),
      field_(field),
      weights_(weights) {}

BandResult SlabObjective::accumulate_gradient(int band_index, std::span<const int> views,
                                              std::span<const loss::ViewModel> models,
                                              double multiplicity, float* gradient) const {
  thread_local Workspace w;
  const std::size_t detector_size = projector_.detector_size(views.size());
  w.fit(projector_.grid().size(), detector_size, sampler_.row_size());
  const auto band = sampler_.band(band_index);
  const std::int64_t width = projector_.geometry().width;
  BandResult result;
  result.views.resize(views.size());

  sampler_.decode(band.first, w.samples.data());
  start_flux(band.first, w);
  for (int slab = band.first; slab < band.end; ++slab) {
    const float* above = density_above(slab, band, w);

    std::fill_n(w.detector.data(), detector_size, 0.0f);
    projector_.forward(w.samples.data(), views, w.detector.data());
    for (std::size_t v = 0; v < views.size(); ++v) {
      result.views[v] +=
          loss::data_term(models[static_cast<std::size_t>(views[v])], multiplicity,
                          measured_.rays(slab, views[v]), measured_.mask(slab, views[v]), width,
                          w.detector.data() + static_cast<std::ptrdiff_t>(v) * width * kLanes);
    }
    w.grad_samples.fill(0.0f);
    projector_.backward(w.detector.data(), views, w.grad_samples.data());
    add_variation(slab, above, w, result);
    result.grad_bias +=
        sampler_.decode_adjoint(slab, w.samples.data(), w.grad_samples.data(), gradient);
    std::swap(w.samples, w.next_samples);
  }
  if (weights_.factor_variation > 0) {
    for (const int leaf : sampler_.leaves_of_band(band_index)) {
      result.variation += field_.parameter_variation(
          leaf, weights_.factor_penalty, weights_.factor_variation, gradient + field_.offset(leaf));
    }
  }
  return result;
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

void SlabObjective::add_variation(int slab, const float* above, Workspace& w,
                                  BandResult& result) const {
  if (weights_.density_variation <= 0) return;
  for (std::size_t s = 0; s < projector_.grid().segments().size(); ++s) {
    const std::ptrdiff_t origin = projector_.grid().segments()[s].origin;
    kernels::SlabVariation variation = variation_of(s);
    variation.samples = w.samples.data() + origin;
    variation.gradient = w.grad_samples.data() + origin;
    variation.num_rows = sampler_.rows_in_slab(slab);
    variation.above = above == nullptr ? nullptr : above + sampler_.row_origin(s);
    variation.flux = w.flux.data() + sampler_.row_origin(s);
    result.variation += kernels::slab_variation(variation);
  }
}

// The flux from the band before into the first row of this one.
void SlabObjective::start_flux(int slab, Workspace& w) const {
  w.flux.fill(0.0f);
  if (slab == 0 || weights_.density_variation <= 0) return;
  sampler_.decode_row(slab * kLanes - 1, w.row.data());
  copy_first_row(w.samples.data(), w.next_row.data());
  for (std::size_t s = 0; s < projector_.grid().segments().size(); ++s) {
    const std::size_t at = sampler_.row_origin(s);
    kernels::row_flux(variation_of(s), w.row.data() + at, w.next_row.data() + at,
                      w.flux.data() + at);
  }
}

// The first row past a slab, and on the way the samples of the slab that holds
// it when that is in the same band: each slab of a band is decoded once.
const float* SlabObjective::density_above(int slab, const projection::SlabSampler::Range& band,
                                          Workspace& w) const {
  if (slab + 1 < band.end) {
    sampler_.decode(slab + 1, w.next_samples.data());
    copy_first_row(w.next_samples.data(), w.next_row.data());
    return w.next_row.data();
  }
  if (slab + 1 == sampler_.num_slabs()) return nullptr;
  if (weights_.density_variation > 0) sampler_.decode_row((slab + 1) * kLanes, w.next_row.data());
  return w.next_row.data();
}

void SlabObjective::copy_first_row(const float* samples, float* row) const {
  const auto& segments = projector_.grid().segments();
  for (std::size_t s = 0; s < segments.size(); ++s) {
    float* out = row + sampler_.row_origin(s);
    for (int i = 0; i < segments[s].nx; ++i) {
      const float* column = samples + segments[s].origin + static_cast<std::ptrdiff_t>(i) * kLanes;
      for (int k = 0; k < segments[s].nz; ++k) *out++ = column[k * segments[s].stride_z()];
    }
  }
}

}  // namespace tomofield::reconstruct
