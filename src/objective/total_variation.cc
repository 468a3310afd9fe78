#include "objective/total_variation.h"

#include <numeric>

#include "base/aligned_buffer.h"
#include "base/parallel.h"
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

// A task has so many samples along x. Each one computes the flux along x into its first sample
// anew, which is a sample more.
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

// The rows beside a pair of slabs, and the flux along y from one row to the next. Padding starts as
// zeros and stays so.
struct DensityVariation::Rows {
  base::AlignedBuffer<float> before, after, flux;

  void fit(std::size_t size) {
    for (base::AlignedBuffer<float>* row : {&before, &after, &flux})
      if (row->size() != size) row->reset(size);
  }
};

// Samples x of a segment, counted in the direction of the differences.
struct DensityVariation::SamplesOfSegment {
  std::size_t segment;
  base::Range x;
};

DensityVariation::DensityVariation(double weight, const kernels::VariationPenalty& penalty,
                                   std::uint64_t seed)
    : weight_(weight), penalty_(penalty), seed_(seed) {}

DensityVariation::~DensityVariation() = default;

double DensityVariation::add_slabs(const Step& step, const SlabBatch& batch,
                                   std::span<measurement::ViewSums>) const {
  if (weight_ <= 0) return 0.0;
  const auto num_pairs = static_cast<std::size_t>(batch.num_pairs());
  const auto rows = rows_.borrow();
  if (rows->size() < num_pairs) rows->resize(num_pairs);
  for (Rows& of_pair : *rows) of_pair.fit(batch.sampler.row_size());
  decode_rows(batch, *rows);

  std::vector<SamplesOfSegment> parts;
  for (std::size_t s = 0; s < batch.projector.grid().segments().size(); ++s) {
    for (const base::Range x : base::parts_of(batch.projector.grid().segments()[s].nx, kTaskWidth))
      parts.push_back({s, x});
  }
  std::vector<double> values(num_pairs * parts.size());
  base::parallel_for("variation", std::ssize(values), [&](std::int64_t i) {
    const auto pair = static_cast<std::size_t>(i) / parts.size();
    values[static_cast<std::size_t>(i)] =
        add_samples(step, batch, batch.pair(static_cast<std::int64_t>(pair)),
                    parts[static_cast<std::size_t>(i) % parts.size()], (*rows)[pair]);
  });
  return std::accumulate(values.begin(), values.end(), 0.0);
}

// Decodes the row before and the row after each pair of slabs, where there are such rows.
void DensityVariation::decode_rows(const SlabBatch& batch, std::span<Rows> rows_of_pair) const {
  struct PieceOfRow {
    std::int64_t row;
    int piece;
    float* densities;
  };
  std::vector<PieceOfRow> pieces;
  const auto add = [&](int slab, std::int64_t row, float* densities) {
    if (slab < 0 || slab >= batch.sampler.num_slabs()) return;
    for (int piece = 0; piece < batch.sampler.num_pieces(slab); ++piece)
      pieces.push_back({row, piece, densities});
  };
  for (int pair = 0; pair < batch.num_pairs(); ++pair) {
    const base::Range slabs = batch.pair(pair);
    Rows& rows = rows_of_pair[static_cast<std::size_t>(pair)];
    add(slabs.begin - 1, std::int64_t{slabs.begin} * kLanes - 1, rows.before.data());
    add(slabs.end, std::int64_t{slabs.end} * kLanes, rows.after.data());
  }
  base::parallel_for("rows beside slabs", std::ssize(pieces), [&](std::int64_t i) {
    const PieceOfRow& piece = pieces[static_cast<std::size_t>(i)];
    batch.sampler.decode_row_piece(piece.row, piece.piece, piece.densities);
  });
}

// Adds the gradient of some samples of a pair of slabs and returns the value of their terms.
double DensityVariation::add_samples(const Step& step, const SlabBatch& batch, base::Range slabs,
                                     const SamplesOfSegment& part, Rows& rows) const {
  const SampleSegment& segment = batch.projector.grid().segments()[part.segment];
  kernels::SlabVariation variation = variation_of(batch, part.segment, step.number);
  variation.x = part.x;
  variation.flux = rows.flux.data() + batch.sampler.row_origin(part.segment);
  if (slabs.begin > 0) {
    kernels::row_flux(variation, decoded_row(batch, rows.before.data(), part.segment),
                      first_row(batch, slabs.begin, part.segment), variation.flux);
  } else {
    kernels::clear_flux(variation);
  }
  double value = 0.0;
  for (int slab = slabs.begin; slab < slabs.end; ++slab) {
    variation.samples = batch.samples(slab) + segment.origin;
    variation.gradient = batch.gradient(slab) + segment.origin;
    variation.num_rows = batch.sampler.rows_in_slab(slab);
    if (slab + 1 == batch.sampler.num_slabs())
      variation.above = {};
    else if (slab + 1 == slabs.end)
      variation.above = decoded_row(batch, rows.after.data(), part.segment);
    else
      variation.above = first_row(batch, slab + 1, part.segment);
    value += kernels::slab_variation(variation);
  }
  return value;
}

void FactorVariation::add_leaves(const Step&, std::span<const int> leaves, float* gradient,
                                 std::span<TermValue> of_leaf) const {
  if (weight_ <= 0) return;
  base::parallel_for("variation of factors", std::ssize(leaves), [&](std::int64_t i) {
    const int leaf = leaves[static_cast<std::size_t>(i)];
    of_leaf[static_cast<std::size_t>(i)].value +=
        field_.parameter_variation(leaf, penalty_, weight_, gradient + field_.offset(leaf));
  });
}

}  // namespace tomofield::objective
