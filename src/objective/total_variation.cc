#include "objective/total_variation.h"

#include "base/aligned_buffer.h"
#include "base/random.h"
#include "kernels/lanes.h"

namespace tomofield::objective {
namespace {

using kernels::kLanes;
using projection::SampleSegment;

// Random streams from here on draw the sides of the differences in each step.
constexpr std::uint64_t kDirectionStream = std::uint64_t{1} << 40;

// Returns the first row of a slab of a batch, where it lies among the others.
kernels::DensityRow first_row(const SlabBatch& batch, int slab, std::size_t segment) {
  const SampleSegment& s = batch.projector.grid().segments()[segment];
  return {batch.samples(slab) + s.origin, kLanes, s.stride_z()};
}

// Returns a segment of a row that was decoded by itself (SlabSampler::decode_row).
kernels::DensityRow decoded_row(const SlabBatch& batch, const float* row, std::size_t segment) {
  return {row + batch.sampler.row_origin(segment), batch.projector.grid().segments()[segment].nz,
          1};
}

// Returns the first row past a slab; none past the last slab of all.
kernels::DensityRow row_above(const SlabBatch& batch, int slab, const float* decoded,
                              std::size_t segment) {
  if (slab + 1 == batch.sampler.num_slabs()) return {};
  if (slab + 1 == batch.slabs.end) return decoded_row(batch, decoded, segment);
  return first_row(batch, slab + 1, segment);
}

}  // namespace

DifferenceSides difference_sides(std::uint64_t seed, std::int64_t step) {
  base::Random random(seed, kDirectionStream + static_cast<std::uint64_t>(step));
  const bool backward_x = random.below(2) == 1;
  return {backward_x, random.below(2) == 1};
}

kernels::SlabVariation DensityVariation::variation_of(const SlabBatch& batch, std::size_t index,
                                                      std::int64_t step) const {
  const SampleSegment& segment = batch.projector.grid().segments()[index];
  const DifferenceSides sides = difference_sides(seed_, step);
  kernels::SlabVariation variation;
  variation.nx = segment.nx;
  variation.nz = segment.nz;
  variation.stride_z = segment.stride_z();
  variation.per_hx = static_cast<float>(1.0 / segment.hx);
  variation.per_hz = static_cast<float>(1.0 / segment.hz);
  variation.weight = static_cast<float>(weight_ * segment.hx * segment.hz);
  variation.penalty = penalty_;
  variation.backward_x = sides.backward_x;
  variation.backward_z = sides.backward_z;
  return variation;
}

// Computes the flux from the last row of the band before into the first row of this one.
void DensityVariation::start_flux(const Step& step, const SlabBatch& batch, float* row,
                                  float* flux) const {
  const int slab = batch.slabs.begin;
  if (slab == 0) return;
  batch.sampler.decode_row(static_cast<std::int64_t>(slab) * kLanes - 1, row);
  for (std::size_t s = 0; s < batch.projector.grid().segments().size(); ++s) {
    kernels::row_flux(variation_of(batch, s, step.number), decoded_row(batch, row, s),
                      first_row(batch, slab, s), flux + batch.sampler.row_origin(s));
  }
}

double DensityVariation::add_slabs(const Step& step, const SlabBatch& batch,
                                   std::span<measurement::ViewSums>) const {
  if (weight_ <= 0) return 0.0;
  // `flux` goes from one slab of a band to the next; `row` is the first row past the batch. Padding
  // starts as zeros and stays so: a new layout needs new buffers.
  thread_local base::AlignedBuffer<float> flux, row;
  if (row.size() != batch.sampler.row_size()) {
    flux.reset(batch.sampler.row_size());
    row.reset(batch.sampler.row_size());
  }
  if (batch.begins_band) {
    flux.fill(0.0f);
    start_flux(step, batch, row.data(), flux.data());
  }
  if (batch.slabs.end < batch.sampler.num_slabs())
    batch.sampler.decode_row(static_cast<std::int64_t>(batch.slabs.end) * kLanes, row.data());
  double value = 0.0;
  for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab) {
    for (std::size_t s = 0; s < batch.projector.grid().segments().size(); ++s) {
      const std::ptrdiff_t origin = batch.projector.grid().segments()[s].origin;
      kernels::SlabVariation variation = variation_of(batch, s, step.number);
      variation.samples = batch.samples(slab) + origin;
      variation.gradient = batch.gradient(slab) + origin;
      variation.num_rows = batch.sampler.rows_in_slab(slab);
      variation.above = row_above(batch, slab, row.data(), s);
      variation.flux = flux.data() + batch.sampler.row_origin(s);
      value += kernels::slab_variation(variation);
    }
  }
  return value;
}

TermValue FactorVariation::add_band(const Step&, int band, float* gradient) const {
  TermValue result;
  if (weight_ <= 0) return result;
  for (const int leaf : sampler_.leaves_of_band(band)) {
    result.value +=
        field_.parameter_variation(leaf, penalty_, weight_, gradient + field_.offset(leaf));
  }
  return result;
}

}  // namespace tomofield::objective
