#include "objective/total_variation.h"

#include <cstdint>
#include <numeric>
#include <vector>

#include "base/aligned_buffer.h"
#include "base/random.h"
#include "base/threads/parallel.h"
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

// Samples of a task along x. Each task also computes the flux along x into its first sample, which
// is a sample more.
constexpr int kTaskWidth = 64;

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

// Holds the row before a band, the row after a batch, and the flux along y from one slab to the
// next.
struct DensityVariation::Rows : Scratch {
  base::AlignedBuffer<float> before, after, flux;

  explicit Rows(std::size_t size) : before(size), after(size), flux(size) {}
  std::span<float> carried() override { return flux; }

  // Decodes the rows beside the slabs of a batch, where there are such rows.
  void decode(const SlabBatch& batch) {
    const projection::SlabSampler& sampler = batch.sampler;
    const std::int64_t first = std::int64_t{batch.slabs.begin} * kLanes;
    const std::int64_t end = std::int64_t{batch.slabs.end} * kLanes;
    const bool has_before = batch.begins_band && batch.slabs.begin > 0;
    const bool has_after = batch.slabs.end < sampler.num_slabs();
    const int num_before = has_before ? sampler.num_pieces(batch.slabs.begin - 1) : 0;
    const int num_after = has_after ? sampler.num_pieces(batch.slabs.end) : 0;
    base::parallel_for("rows beside slabs", num_before + num_after, [&](std::int64_t i) {
      const int piece = static_cast<int>(i);
      if (piece < num_before)
        sampler.decode_row_piece(first - 1, piece, before.data());
      else
        sampler.decode_row_piece(end, piece - num_before, after.data());
    });
  }
};

// Samples x of a segment, counted in the direction of the differences.
struct DensityVariation::SamplesOfSegment {
  std::size_t segment;
  base::Range x;
};

std::unique_ptr<Term::Scratch> DensityVariation::make_scratch(
    const projection::SlabSampler& sampler) const {
  return std::make_unique<Rows>(sampler.row_size());
}

double DensityVariation::add_slabs(const Step& step, const SlabBatch& batch, Scratch* scratch,
                                   std::span<measurement::ViewSums>) const {
  if (weight_ <= 0) return 0.0;
  auto& rows = static_cast<Rows&>(*scratch);
  rows.decode(batch);
  std::vector<SamplesOfSegment> parts;
  for (std::size_t s = 0; s < batch.projector.grid().segments().size(); ++s) {
    for (const base::Range x : base::parts_of(batch.projector.grid().segments()[s].nx, kTaskWidth))
      parts.push_back({s, x});
  }
  std::vector<double> values(parts.size());
  base::parallel_for("variation", std::ssize(parts), [&](std::int64_t i) {
    const auto part = static_cast<std::size_t>(i);
    values[part] = add_samples(step, batch, parts[part], rows);
  });
  return std::accumulate(values.begin(), values.end(), 0.0);
}

// Adds the gradient of some samples of the slabs, one slab after another, and returns the value of
// their terms.
double DensityVariation::add_samples(const Step& step, const SlabBatch& batch,
                                     const SamplesOfSegment& part, Rows& rows) const {
  const SampleSegment& segment = batch.projector.grid().segments()[part.segment];
  kernels::SlabVariation variation = variation_of(batch, part.segment, step.number);
  variation.x = part.x;
  variation.flux = rows.flux.data() + batch.sampler.row_origin(part.segment);
  if (batch.begins_band && batch.slabs.begin > 0) {
    kernels::row_flux(variation, decoded_row(batch, rows.before.data(), part.segment),
                      first_row(batch, batch.slabs.begin, part.segment), variation.flux);
  } else if (batch.begins_band) {
    kernels::clear_flux(variation);
  }
  double value = 0.0;
  for (int slab = batch.slabs.begin; slab < batch.slabs.end; ++slab) {
    variation.samples = batch.samples(slab) + segment.origin;
    variation.gradient = batch.gradient(slab) + segment.origin;
    variation.num_rows = batch.sampler.rows_in_slab(slab);
    variation.above = row_above(batch, slab, rows.after.data(), part.segment);
    value += kernels::slab_variation(variation);
  }
  return value;
}

class FactorVariation::OfLeaves : public LeafPass {
 public:
  OfLeaves(const FactorVariation& term, std::span<const int> leaves)
      : term_(term), leaves_(leaves) {}

  TermValue add_leaf(std::size_t index, float* gradient) override {
    const field::Field& field = term_.field_;
    const int leaf = leaves_[index];
    return {.value = field.parameter_variation(leaf, term_.penalty_, term_.weight_,
                                               gradient + field.offset(leaf))};
  }

 private:
  const FactorVariation& term_;
  std::span<const int> leaves_;
};

std::unique_ptr<Term::LeafPass> FactorVariation::leaf_pass(const Step&,
                                                           std::span<const int> leaves) const {
  return weight_ > 0 ? std::make_unique<OfLeaves>(*this, leaves) : nullptr;
}

}  // namespace tomofield::objective
