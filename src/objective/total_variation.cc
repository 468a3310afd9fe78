#include "objective/total_variation.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

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

// Holds the row before a band, the row after each pair of slabs, and the flux along y from one slab
// to the next. Padding starts as zeros and stays so.
struct DensityVariation::Rows : Scratch {
  base::AlignedBuffer<float> before, flux;
  std::vector<base::AlignedBuffer<float>> after;

  void fit(std::size_t size, int num_pairs) {
    after.resize(std::max(after.size(), static_cast<std::size_t>(num_pairs)));
    const auto fit_row = [size](base::AlignedBuffer<float>& row) {
      if (row.size() != size) row.reset(size);
    };
    fit_row(before);
    fit_row(flux);
    std::ranges::for_each(after, fit_row);
  }

  // Decodes the rows beside the slabs of a batch, where there are such rows.
  void decode(const SlabBatch& batch) {
    const projection::SlabSampler& sampler = batch.sampler;
    struct PieceOfRow {
      std::int64_t row;
      int piece;
      float* densities;
    };
    std::vector<PieceOfRow> pieces;
    const auto add = [&](std::int64_t row, float* densities) {
      const auto slab = static_cast<int>(row / kLanes);
      for (int piece = 0; piece < sampler.num_pieces(slab); ++piece)
        pieces.push_back({row, piece, densities});
    };
    if (batch.begins_band && batch.slabs.begin > 0)
      add(std::int64_t{batch.slabs.begin} * kLanes - 1, before.data());
    for (int pair = 0; pair < batch.num_pairs(); ++pair) {
      const int next = batch.pair(pair).end;
      if (next < sampler.num_slabs())
        add(std::int64_t{next} * kLanes, after[static_cast<std::size_t>(pair)].data());
    }
    base::parallel_for("rows beside slabs", std::ssize(pieces), [&](std::int64_t i) {
      const PieceOfRow& piece = pieces[static_cast<std::size_t>(i)];
      sampler.decode_row_piece(piece.row, piece.piece, piece.densities);
    });
  }
};

// Samples x of a segment, counted in the direction of the differences.
struct DensityVariation::SamplesOfSegment {
  std::size_t segment;
  base::Range x;
};

std::unique_ptr<Term::Scratch> DensityVariation::make_scratch() const {
  return std::make_unique<Rows>();
}

double DensityVariation::add_slabs(const Step& step, const SlabBatch& batch, Scratch* scratch,
                                   std::span<measurement::ViewSums>) const {
  if (weight_ <= 0) return 0.0;
  auto& rows = static_cast<Rows&>(*scratch);
  rows.fit(batch.sampler.row_size(), batch.num_pairs());
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
    const auto pair = static_cast<std::size_t>(slab - batch.slabs.begin) / 2;
    variation.samples = batch.samples(slab) + segment.origin;
    variation.gradient = batch.gradient(slab) + segment.origin;
    variation.num_rows = batch.sampler.rows_in_slab(slab);
    if (slab + 1 == batch.sampler.num_slabs())
      variation.above = {};
    else if (slab + 1 == batch.pair(static_cast<std::int64_t>(pair)).end)
      variation.above = decoded_row(batch, rows.after[pair].data(), part.segment);
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
