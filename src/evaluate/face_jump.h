#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/volume.h"
#include "evaluate/speckle.h"
#include "field/tree/quadtree.h"
#include "tomofield/options.h"

namespace tomofield::evaluate {

/// Where a pair of neighbouring voxels lies: in two leaves, in one leaf but near a face along the
/// direction of the pair, or elsewhere.
enum class PairPlace : char { kElsewhere, kNearFace, kAcrossFace };

/// How visible the faces of leaves are in a volume: the mean absolute difference of neighbouring
/// voxels that lie in different leaves, over that of neighbouring voxels of one leaf within
/// eight voxels of a face. Pairs further away would compare one part of the specimen with
/// another. 1 means that no face is visible. An axis along which no face lies has no value.
struct FaceJump {
  double both = 0.0;           ///< pairs along x and along y together
  std::optional<double> x, y;  ///< pairs along one axis
};

/// The faces of a tree's leaves among the voxels of a region, one voxel a pixel. Rows and columns
/// count from the region's first.
class LeafFaces {
 public:
  /// `tree` must outlive the object.
  LeafFaces(const field::Quadtree& tree, const Rectangle& region) : tree_(tree), region_(region) {}

  const Rectangle& region() const { return region_; }
  /// Returns for each voxel of a row but the last where its pair with the next one lies.
  std::vector<PairPlace> pairs_along_x(std::int64_t row) const;
  /// Returns for each voxel of a row where its pair with that of the next row lies.
  std::vector<PairPlace> pairs_along_y(std::int64_t row) const;

 private:
  const field::Quadtree& tree_;
  Rectangle region_;
};

/// Sums of absolute differences over pairs of neighbouring voxels at faces and near them: those of
/// one row, and those of a row and the next one.
struct RowJumps {
  double across_x = 0.0, near_x = 0.0;
  double across_y = 0.0, near_y = 0.0;
  RowJumps& operator+=(const RowJumps& other);
};
/// Computes the sums of row `y` of a block, which is `row` of the region. Pairs with the next row
/// count if the block has one. The block is as wide as the region.
RowJumps row_jumps(const VoxelBlock& block, std::int64_t y, const LeafFaces& faces,
                   std::int64_t row);

/// Returns the ratios from the sums of all rows of the region, in their order. Returns nothing if
/// no face lies in the region, and if the density is constant near faces.
std::optional<FaceJump> face_jump(std::span<const RowJumps> rows, const LeafFaces& faces,
                                  std::int64_t num_sections);
/// Does the same for a volume of the size of the region.
std::optional<FaceJump> face_jump(const base::Volume& volume, const LeafFaces& faces);

}  // namespace tomofield::evaluate
