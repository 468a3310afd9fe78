#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/range.h"
#include "field/field.h"
#include "prior/network.h"
#include "tomofield/options.h"

namespace tomofield::prior {

/// The vertices of a region of interest that lie on the centres of its pixels, as one lattice over
/// all leaves. Leaves of the margin are not part of it.
class Lattice {
 public:
  /// The leaves of the region must have plain vertices, all as many, a pixel apart. The field must
  /// outlive the lattice.
  Lattice(const field::Field& field, const Rectangle& roi);

  /// Returns the vertices along each axis: a pixel of the region, and of the thickness, each.
  const BoxShape& shape() const { return shape_; }
  /// Returns the rows (y) that begin in some bands of root cells of the tree. The row on the face
  /// between two bands is the first one of the upper band.
  base::Range rows_of(base::Range bands) const;

  /// Some vertices along each axis. Those beyond the lattice stand for their mirror images in it.
  struct Part {
    base::Range x, z, y;
    BoxShape shape() const { return {x.size(), z.size(), y.size()}; }
  };
  /// Copies densities of a part into `box` [x, z, y]. `parameters` are those of the field or have
  /// their places.
  void read(std::span<const float> parameters, const Part& part, std::span<float> box) const;
  /// Writes densities of a part that lies in the lattice. A vertex on a face of leaves is written
  /// in all of them.
  void write(std::span<const float> box, const Part& part, std::span<float> parameters) const;

 private:
  // Where a column or a row of the lattice lies in a leaf.
  struct Place {
    int cell = 0, vertex = 0;
  };
  std::vector<Place> places(std::int64_t first, int count, std::int64_t cells_begin) const;

  const field::Field& field_;
  BoxShape shape_;
  std::int64_t first_row_;  // in the field's coordinates
  int leaf_size_ = 0, num_columns_ = 0;
  std::vector<int> leaves_;  // [row of cells, column of cells]
  std::vector<Place> x_, y_;
};

}  // namespace tomofield::prior
