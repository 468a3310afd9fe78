#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/aligned_buffer.h"
#include "baseline/neural/dense_network.h"
#include "baseline/neural/encodings.h"
#include "baseline/solver.h"
#include "projection/sample_grid.h"

namespace tomofield::baseline {

/// Returns the size of the box that holds all samples of a grid, in pixels along x, y and z.
Point box_of(const projection::SampleGrid& grid, std::int64_t num_rows);

/// The rows of a slab that are computed together: lanes first, first + kStride, … up to the last
/// row.
struct RowSet {
  static constexpr int kStride = 4;
  int slab = 0, first = 0;
  int num_rows = 0;

  std::uint16_t lanes() const;  ///< the set's lanes, a bit each
  /// Returns the row sets of all slabs. None of them is empty.
  static std::vector<RowSet> all(std::int64_t num_rows);
};

/// Computes densities with a network from encoded positions, at the samples of slabs (the buffers
/// of VoxelVolume):
///   density = softplus(network + bias), or network + bias where densities may be negative.
/// The softplus is as sharp as that of the main method's field. The bias is fixed: a network that
/// returns zero has the mean density.
class NetworkDensity {
 public:
  struct Shape {
    int hidden_layers = 2, width = 32;
    Activation activation = Activation::kRectifier;
    bool non_negative = true;
    double mean_density = 0;
    std::uint64_t seed = 1;
  };
  /// Makes a density for the samples of `grid`, which must outlive it.
  NetworkDensity(const projection::SampleGrid& grid, std::int64_t num_rows,
                 std::unique_ptr<PointEncoding> encoding, const Shape& shape);

  /// Returns the parameters of the encoding, followed by those of the network.
  std::span<float> parameters() { return parameters_; }
  std::size_t num_parameters() const { return parameters_.size(); }
  /// Returns the number of parameters of such a density and the memory that it and its threads
  /// take, before anything is allocated.
  static MethodSize size(const projection::SampleGrid& grid, std::int64_t num_rows,
                         const PointEncoding& encoding, const Shape& shape, int num_threads);

  /// Writes the densities of some rows of a slab's samples. The other rows stay as they are.
  void decode(const RowSet& rows, float* samples);
  /// Adds the gradient of Σ grad_samples · samples of these rows by the parameters to `gradient`.
  /// The result has the same bits for any number of threads.
  void accumulate(const RowSet& rows, const float* grad_samples, std::span<float> gradient);

 private:
  // Columns of a z row that are computed at once; a column has a few samples.
  struct Chunk {
    const projection::SampleSegment* segment;
    int k, first, size;
    std::size_t index;  ///< index of the first column among all
  };
  // The number of values of each kind.
  struct Counts {
    std::size_t parameters, points, grad_features, parts;
  };
  static Counts counts_of(const projection::SampleGrid& grid, std::int64_t num_rows,
                          const PointEncoding& encoding, const DenseNetwork& network);
  std::span<const float> encoding_parameters() const;
  std::span<const float> network_parameters() const;
  std::span<Point> points_of(const Chunk& chunk, const RowSet& rows);
  std::span<float> evaluate(const Chunk& chunk, const RowSet& rows, DenseNetwork::Batch& batch);
  void accumulate_chunk(const Chunk& chunk, const RowSet& rows, const float* grad_samples,
                        DenseNetwork::Batch& batch, std::span<float> gradient);

  double low_x_;
  std::unique_ptr<PointEncoding> encoding_;
  DenseNetwork network_;
  bool non_negative_;
  float bias_;
  base::AlignedBuffer<float> parameters_;
  std::vector<Chunk> chunks_;
  std::size_t num_columns_ = 0;
  // points_ is [column, row] of a set of rows. grad_features_ is [column, row, feature] where the
  // encoding is fitted, and empty elsewhere.
  std::vector<Point> points_;
  std::vector<float> grad_features_;
  std::vector<float> parts_;  // gradients of the network by parts of a slab
};

}  // namespace tomofield::baseline
