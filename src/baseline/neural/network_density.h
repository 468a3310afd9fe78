#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/aligned_buffer.h"
#include "baseline/neural/dense_network.h"
#include "baseline/neural/point_encoding.h"
#include "baseline/solver.h"
#include "projection/sample_grid.h"

namespace tomofield::baseline {

/// The box that all samples of a grid lie in, in pixels.
Point box_of(const projection::SampleGrid& grid, std::int64_t num_rows);

/// Rows of a slab that are computed together: lanes first, first + kStride, … up to the last row.
struct RowSet {
  static constexpr int kStride = 4;
  int slab = 0, first = 0;
  int num_rows = 0;

  std::uint16_t lanes() const;  ///< a bit each
  /// Of all slabs, none of them empty.
  static std::vector<RowSet> all(std::int64_t num_rows);
};

/// A density that a network computes from an encoded position, at the samples of slabs (the
/// buffers of VoxelVolume):
///   density = softplus(network + bias), or network + bias where densities may be negative,
/// softplus as sharp as that of the main method's field.
/// The bias is fixed: a network that says zero has the mean density.
class NetworkDensity {
 public:
  struct Shape {
    int hidden_layers = 2, width = 32;
    Activation activation = Activation::kRectifier;
    bool non_negative = true;
    double mean_density = 0;
    std::uint64_t seed = 1;
  };
  /// `grid` must outlive it.
  NetworkDensity(const projection::SampleGrid& grid, std::int64_t num_rows,
                 std::unique_ptr<PointEncoding> encoding, const Shape& shape);

  /// Of the encoding, then of the network.
  std::span<float> parameters() { return parameters_; }
  std::size_t num_parameters() const { return parameters_.size(); }
  /// The parameters of such a density, and what it and so many threads take: known before anything
  /// is allocated.
  static MethodSize size(const projection::SampleGrid& grid, std::int64_t num_rows,
                         const PointEncoding& encoding, const Shape& shape, int num_threads);

  /// Densities of some rows of a slab's samples; the others stay as they are.
  void decode(const RowSet& rows, float* samples);
  /// Adds the gradient of Σ grad_samples · samples of these rows by the parameters to `gradient`.
  /// The same bits for any number of threads.
  void accumulate(const RowSet& rows, const float* grad_samples, std::span<float> gradient);

 private:
  // Columns of a z row, of a few samples each, that are computed at once.
  struct Chunk {
    const projection::SampleSegment* segment;
    int k, first, size;
    std::size_t index;  ///< of the first column, among all
  };
  // How many values there are of each kind.
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
  // Of a set of rows: [column, row], and [column, row, feature] where the encoding is fitted.
  std::vector<Point> points_;
  std::vector<float> grad_features_;
  std::vector<float> parts_;  // gradients of the network, summed apart
};

}  // namespace tomofield::baseline
