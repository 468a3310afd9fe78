#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/range.h"
#include "field/field.h"
#include "projection/sample_grid.h"

namespace tomofield::projection {

/// Evaluates a field at the samples of a slab and carries gradients back. It connects leaves, which
/// know nothing of sampling, with the projector, which knows nothing of leaves.
///
/// Slab s covers rows first_row + pixel · [16 s, 16 (s + 1)). The grid and the rows count the
/// pixels of a coarse stage; each is `pixel` pixels of the field wide. first_row is in pixels of
/// the field.
///
/// Make a new one when the tree changes. Thread-safe; `field` must outlive it and may change its
/// parameters.
class SlabSampler {
 public:
  SlabSampler(const field::Field& field, const SampleGrid& grid, std::int64_t first_row,
              std::int64_t num_rows, int pixel = 1);

  int num_slabs() const { return static_cast<int>(slabs_.size()); }
  /// Returns the rows of the volume in a slab: 16, or fewer in the last one.
  int rows_in_slab(int slab) const;
  int num_bands() const { return static_cast<int>(bands_.size()); }
  /// Returns the slabs of a band of root cells, 0 <= index < num_bands().
  base::Range band(int index) const { return bands_[static_cast<std::size_t>(index)]; }

  /// Overwrites `samples` with the densities of a slab; leaves the padding as it is.
  void decode(int slab, float* samples) const;
  /// Adds dL/d parameters to gradient (all parameters), given dL/d samples; returns dL/d bias.
  double decode_adjoint(int slab, const float* samples, const float* grad_samples,
                        float* gradient) const;
  /// Computes the densities of one row, counted from first_row, as [segment][x][z] without padding.
  void decode_row(std::int64_t row, float* densities) const;

  /// Returns the number of pieces in which a slab is decoded. A piece is the samples of one segment
  /// that lie in one leaf. Different pieces may be decoded at the same time.
  int num_pieces(int slab) const {
    return static_cast<int>(slabs_[static_cast<std::size_t>(slab)].size());
  }
  /// Does the part of decode() that belongs to a piece.
  void decode_piece(int slab, int piece, float* samples) const;
  /// Does the part of decode_row() that belongs to a piece of the row's slab.
  void decode_row_piece(std::int64_t row, int piece, float* densities) const;
  /// Does the part of decode_adjoint() that belongs to a leaf. Different leaves may be worked on at
  /// the same time.
  double decode_adjoint_of_leaf(int leaf, int slab, const float* samples, const float* grad_samples,
                                float* gradient) const;
  /// Returns the floats that decode_row writes.
  std::size_t row_size() const { return row_origins_.back(); }
  /// Returns the position of a segment's first float in them.
  std::size_t row_origin(std::size_t segment) const { return row_origins_[segment]; }

  /// Returns the leaves that the slabs of a band sample, ascending.
  std::vector<int> leaves_of_band(int band) const { return leaves_of_slabs(this->band(band)); }
  /// Returns the leaves that some slabs sample, ascending.
  std::vector<int> leaves_of_slabs(base::Range slabs) const;

 private:
  // The samples of one segment that lie in one leaf.
  struct Piece {
    int leaf = 0;
    std::size_t segment = 0;
    int first_sample = 0;
    std::vector<int> lower_x;
    std::vector<float> fraction_x;
    field::LaneRows rows;
  };
  // The interpolation along z for a number of vertices, which pieces share.
  struct TapsZ {
    std::size_t segment = 0;
    int num_vertices = 0;
    std::vector<int> lower;
    std::vector<float> fraction;
  };
  std::vector<Piece> pieces_across(std::int64_t row) const;
  const TapsZ& taps_z(std::size_t segment, int num_vertices) const;
  kernels::LeafPiece kernel_piece(const Piece& piece) const;
  std::ptrdiff_t sample_offset(const Piece& piece) const;
  double adjoint_of_piece(const Piece& piece, const float* samples, const float* grad_samples,
                          float* gradient) const;

  const field::Field& field_;
  SampleGrid grid_;
  /// Returns the field's y coordinate of row `row`, which is counted from the first one.
  double row_centre(std::int64_t row) const {
    return static_cast<double>(first_row_) + pixel_ * (static_cast<double>(row) + 0.5);
  }

  std::int64_t first_row_, num_rows_;
  int pixel_;
  std::vector<std::vector<Piece>> slabs_;
  std::vector<base::Range> bands_;
  std::vector<TapsZ> taps_z_;
  std::vector<std::size_t> row_origins_;
};

}  // namespace tomofield::projection
