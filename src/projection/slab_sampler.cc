#include "projection/slab_sampler.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/aligned_buffer.h"
#include "base/check.h"
#include "field/sampling/resample.h"
#include "kernels/lanes.h"

namespace tomofield::projection {
namespace {

using kernels::kLanes;

float* scratch(std::size_t size, int which) {
  thread_local base::AlignedBuffer<float> buffers[2];
  buffers[which].reserve(size);
  return buffers[which].data();
}

}  // namespace

SlabSampler::SlabSampler(const field::Field& field, const SampleGrid& grid, std::int64_t first_row,
                         std::int64_t num_rows, int pixel)
    : field_(field), grid_(grid), first_row_(first_row), num_rows_(num_rows), pixel_(pixel) {
  const auto& segments = grid.segments();
  row_origins_.assign(1, 0);
  for (std::size_t s = 0; s < segments.size(); ++s) {
    row_origins_.push_back(row_origins_.back() +
                           static_cast<std::size_t>(segments[s].nx) * segments[s].nz);
    for (const field::LeafShape& shape : field.shapes()) {
      const auto known = [&](const TapsZ& t) {
        return t.segment == s && t.num_vertices == shape.nz;
      };
      if (std::any_of(taps_z_.begin(), taps_z_.end(), known)) continue;
      TapsZ taps{.segment = s, .num_vertices = shape.nz, .lower = {}, .fraction = {}};
      for (int k = 0; k < segments[s].nz; ++k) {
        const double height = pixel * (k + 0.5) * segments[s].hz - field::kPixelCentre;
        const field::AxisPoint at(height / field::vertex_height(field.thickness()) * (shape.nz - 1),
                                  shape.nz);
        taps.lower.push_back(static_cast<int>(at.lower));
        taps.fraction.push_back(static_cast<float>(at.fraction));
      }
      taps_z_.push_back(std::move(taps));
    }
  }
  const std::int64_t band_rows = field.tree().roots().cell_size / pixel;
  TOMOFIELD_CHECK(field.tree().roots().y0 == first_row,
                  "slabs and root cells start at the same row");
  for (std::int64_t y = 0; y < num_rows; y += kLanes) {
    if (y % band_rows == 0) bands_.push_back({num_slabs(), num_slabs()});
    slabs_.push_back(pieces_across(y));
    bands_.back().end = num_slabs();
  }
}

int SlabSampler::rows_in_slab(int slab) const {
  return static_cast<int>(
      std::min<std::int64_t>(kLanes, num_rows_ - static_cast<std::int64_t>(slab) * kLanes));
}

std::vector<SlabSampler::Piece> SlabSampler::pieces_across(std::int64_t row) const {
  const std::int64_t y0 = first_row_ + pixel_ * row, y1 = y0 + pixel_ * kLanes;
  std::array<double, kLanes> y{};
  for (int l = 0; l < kLanes; ++l) y[static_cast<std::size_t>(l)] = row_centre(row + l);
  std::vector<Piece> pieces;
  for (const int leaf : field_.tree().leaves_across(y0, y1)) {
    const field::Square& square = field_.tree().leaf(leaf).square;
    TOMOFIELD_CHECK(square.y0 <= y0 && square.y1() >= y1,
                    fmt::format("a slab straddles leaf {}", leaf));
    const field::Quadtree::Bounds bounds = field_.tree().bounds(square);
    const field::LeafShape& shape = field_.shape(leaf);
    for (std::size_t s = 0; s < grid_.segments().size(); ++s) {
      const SampleSegment& segment = grid_.segments()[s];
      Piece piece;
      piece.leaf = leaf;
      piece.segment = s;
      for (int i = 0; i < segment.nx; ++i) {
        const double x = pixel_ * (segment.x0 + (i + 0.5) * segment.hx);
        if (x < bounds.x0 || x >= bounds.x1) continue;
        if (piece.lower_x.empty()) piece.first_sample = i;
        const field::AxisPoint at(field_.vertex_x(leaf, x), shape.nx);
        piece.lower_x.push_back(static_cast<int>(at.lower));
        piece.fraction_x.push_back(static_cast<float>(at.fraction));
      }
      if (piece.lower_x.empty()) continue;
      piece.rows = field_.lane_rows(leaf, y);
      pieces.push_back(std::move(piece));
    }
  }
  return pieces;
}

const SlabSampler::TapsZ& SlabSampler::taps_z(std::size_t segment, int num_vertices) const {
  const auto found = std::find_if(taps_z_.begin(), taps_z_.end(), [&](const TapsZ& t) {
    return t.segment == segment && t.num_vertices == num_vertices;
  });
  TOMOFIELD_CHECK(found != taps_z_.end(),
                  fmt::format("no leaf has {} vertices in z", num_vertices));
  return *found;
}

kernels::LeafPiece SlabSampler::kernel_piece(const Piece& piece) const {
  const int num_vertices = field_.shape(piece.leaf).nz;
  const TapsZ& z = taps_z(piece.segment, num_vertices);
  return {
      .num_vertices_z = num_vertices,
      .x = {static_cast<int>(piece.lower_x.size()), piece.lower_x.data(), piece.fraction_x.data()},
      .z = {static_cast<int>(z.lower.size()), z.lower.data(), z.fraction.data()},
      .stride_z = grid_.segments()[piece.segment].stride_z(),
      .activation = field_.activation};
}

std::ptrdiff_t SlabSampler::sample_offset(const Piece& piece) const {
  return grid_.segments()[piece.segment].origin +
         static_cast<std::ptrdiff_t>(piece.first_sample) * kLanes;
}

void SlabSampler::decode(int slab, float* samples) const {
  for (int piece = 0; piece < num_pieces(slab); ++piece) decode_piece(slab, piece, samples);
}

void SlabSampler::decode_piece(int slab, int index, float* samples) const {
  const Piece& piece = slabs_[static_cast<std::size_t>(slab)][static_cast<std::size_t>(index)];
  float* values = scratch(field_.shape(piece.leaf).vertices_xz() * kLanes, 0);
  field_.slab_values(piece.leaf, piece.rows, values);
  kernels::decode_leaf(kernel_piece(piece), values, samples + sample_offset(piece));
}

double SlabSampler::adjoint_of_piece(const Piece& piece, const float* samples,
                                     const float* grad_samples, float* gradient) const {
  const std::size_t size = field_.shape(piece.leaf).vertices_xz() * kLanes;
  float* grad_values = scratch(size, 1);
  std::fill_n(grad_values, size, 0.0f);
  const std::ptrdiff_t at = sample_offset(piece);
  const double grad_bias = kernels::decode_leaf_adjoint(kernel_piece(piece), samples + at,
                                                        grad_samples + at, grad_values);
  field_.slab_gradient(piece.leaf, piece.rows, grad_values, gradient + field_.offset(piece.leaf));
  return grad_bias;
}

double SlabSampler::decode_adjoint(int slab, const float* samples, const float* grad_samples,
                                   float* gradient) const {
  double grad_bias = 0.0;
  for (const Piece& piece : slabs_[static_cast<std::size_t>(slab)])
    grad_bias += adjoint_of_piece(piece, samples, grad_samples, gradient);
  return grad_bias;
}

double SlabSampler::decode_adjoint_of_leaf(int leaf, int slab, const float* samples,
                                           const float* grad_samples, float* gradient) const {
  double grad_bias = 0.0;
  for (const Piece& piece : slabs_[static_cast<std::size_t>(slab)]) {
    if (piece.leaf == leaf) grad_bias += adjoint_of_piece(piece, samples, grad_samples, gradient);
  }
  return grad_bias;
}

void SlabSampler::decode_row(std::int64_t row, float* densities) const {
  for (int piece = 0; piece < num_pieces(static_cast<int>(row / kLanes)); ++piece)
    decode_row_piece(row, piece, densities);
}

void SlabSampler::decode_row_piece(std::int64_t row, int index, float* densities) const {
  const Piece& piece =
      slabs_[static_cast<std::size_t>(row / kLanes)][static_cast<std::size_t>(index)];
  const field::LeafShape& shape = field_.shape(piece.leaf);
  float* values = scratch(shape.vertices_xz(), 0);
  field_.row_values(piece.leaf, row_centre(row), values);
  const TapsZ& z = taps_z(piece.segment, shape.nz);
  const int nz = grid_.segments()[piece.segment].nz;
  float* const first =
      densities + row_origins_[piece.segment] + static_cast<std::size_t>(piece.first_sample) * nz;
  float* out = first;
  for (std::size_t i = 0; i < piece.lower_x.size(); ++i, out += nz) {
    const float* lower = values + static_cast<std::ptrdiff_t>(piece.lower_x[i]) * shape.nz;
    const float fx = piece.fraction_x[i];
    const auto at = [&](int k) { return lower[k] + fx * (lower[shape.nz + k] - lower[k]); };
    for (int k = 0; k < nz; ++k) {
      const float low = at(z.lower[static_cast<std::size_t>(k)]);
      out[k] = low + z.fraction[static_cast<std::size_t>(k)] *
                         (at(z.lower[static_cast<std::size_t>(k)] + 1) - low);
    }
  }
  kernels::activate(field_.activation, first, out - first);
}

std::vector<int> SlabSampler::leaves_of_slabs(base::Range slabs) const {
  std::vector<int> leaves;
  for (int slab = slabs.begin; slab < slabs.end; ++slab) {
    for (const Piece& piece : slabs_[static_cast<std::size_t>(slab)]) leaves.push_back(piece.leaf);
  }
  std::sort(leaves.begin(), leaves.end());
  leaves.erase(std::unique(leaves.begin(), leaves.end()), leaves.end());
  return leaves;
}

}  // namespace tomofield::projection
