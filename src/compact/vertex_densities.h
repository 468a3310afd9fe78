#pragma once

#include <Eigen/Dense>
#include <array>
#include <vector>

#include "base/range.h"
#include "field/field.h"
#include "tomofield/options.h"

namespace tomofield::compact {

using FloatMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The densities of a finished field at the vertices of a square of the specimen's plane, but for
/// those on its upper faces, which the next squares have. The vertices are as far apart as those of
/// the field. The voxels of the region of interest depend on the vertices inside it and on those
/// next to them. All others are 0.
struct PlaceDensities {
  int nx = 0, ny = 0, nz = 0;
  FloatMatrix values;                        ///< [nx, nz·ny], y fastest
  double volume_of_vertex = 0.0;             ///< that a vertex stands for, in cubic pixels
  base::Range inside_x = {}, inside_y = {};  ///< of the vertices in the region of interest

  /// Returns the volume in the region of interest.
  double volume() const;
  /// Returns the integrals of the density and of its square over the region of interest.
  std::array<double, 2> integrals() const;
};

/// Reads the densities of a field of plain vertices in squares that need not be its leaves. Where
/// leaves share a face, a density is the mean of theirs, so that all squares agree on their faces.
class VertexDensities {
 public:
  /// `vertices` is of kind "grid" and must outlive the object. `roi` is the region of interest.
  VertexDensities(const field::Field& vertices, const Rectangle& roi);

  const field::Field& field() const { return vertices_; }
  const Rectangle& roi() const { return roi_; }
  /// Returns the smallest side of a square that can be read: half a leaf, and so on, as long as
  /// sides stay multiples of a slab's rows and vertices fall on vertices.
  std::int64_t smallest_side() const { return smallest_side_; }
  /// Returns a leaf that holds a part of the square if every part of it belongs to leaves of one
  /// region whose vertices are equally far apart, and −1 otherwise.
  int leaf_like(const field::Square& square) const;
  /// Returns true if no leaf of the field or no part of the region of interest is in the square.
  bool is_outside(const field::Square& square) const;
  /// Returns the densities of a square for which leaf_like() finds a leaf.
  PlaceDensities read(const field::Square& square) const;

 private:
  std::vector<int> leaves_near(const field::Square& square, std::int64_t reach) const;
  bool are_alike(int leaf, int other) const;

  const field::Field& vertices_;
  Rectangle roi_;
  std::int64_t smallest_side_ = 0;
};

}  // namespace tomofield::compact
