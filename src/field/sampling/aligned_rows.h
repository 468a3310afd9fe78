#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "base/aligned_buffer.h"
#include "field/field.h"
#include "field/sampling/sample_box.h"

namespace tomofield::field {

/// Evaluates a box that is aligned with the field's axes, up to 16 rows of points at a time. It
/// contracts leaves once for those rows (the lanes of a slab), and then interpolates in x and z. It
/// is the inner part of sample_box. Thread-safe.
class AlignedRows {
 public:
  AlignedRows(const Field& field, const OrientedBox& box);

  /// Returns the rows of voxels that fill the lanes: 16, or fewer if each has several rows of
  /// points.
  std::int64_t rows_at_once() const;

  /// The values of one leaf at up to 16 rows of points.
  struct LeafRows {
    int leaf = 0;
    int first_lane = 0, end_lane = 0;  ///< rows of points inside the leaf
    std::int64_t first_point_row = 0;  ///< row of lane 0, counted from the block's first
    std::int64_t first_point_x = 0;
    std::vector<int> lower_x;  ///< x taps of the points inside the leaf
    std::vector<float> fraction_x;
    base::AlignedBuffer<float> values;  ///< [x vertex, z vertex, lane]
  };
  /// Returns the values of every leaf that rows [first_row, first_row + num_rows) of voxels meet.
  std::vector<LeafRows> contract(std::int64_t first_row, std::int64_t num_rows) const;

  /// Adds the densities of sections [first, first + count) to voxels [section, row, x], which must
  /// be zero at the start.
  void decode(const std::vector<LeafRows>& leaves, std::int64_t first, std::int64_t count,
              std::int64_t num_rows, float* voxels) const;

 private:
  // The z taps of all points inside the specimen, for one number of vertices.
  struct TapsZ {
    std::vector<int> lower;
    std::vector<float> fraction;
  };
  double coordinate(int axis, std::int64_t point) const;
  void contract_lanes(std::int64_t block_first, std::int64_t lanes_first, int num_lanes,
                      std::vector<LeafRows>& leaves) const;
  void add_samples(const LeafRows& rows, std::int64_t first_x, std::int64_t num_x,
                   std::int64_t first_z, std::int64_t num_z, const float* samples,
                   std::int64_t first_section, std::int64_t num_rows, float* voxels) const;

  const Field& field_;
  OrientedBox box_;
  std::int64_t factor_;                   // points a voxel along each axis
  std::int64_t first_z_ = 0, end_z_ = 0;  // points inside the thickness
  std::map<int, TapsZ> taps_z_;           // the key is the number of vertices
};

}  // namespace tomofield::field
