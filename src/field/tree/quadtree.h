#pragma once

#include <cstdint>
#include <vector>

namespace tomofield::field {

/// The part of the domain to which a root cell belongs: the region of interest, or the margin
/// around it that rays cross.
enum class Region : std::uint8_t { kInterest, kMargin };

/// The centre of a pixel: pixel i of the aligned view at zero tilt covers [i, i + 1). Faces of
/// squares, and with them vertices at a spacing of one pixel, lie on centres of pixels. The samples
/// of a fit then read single vertices. Between vertices they would read means of eight, and the fit
/// would recover sharp detail slowly (docs/results/ablation.md).
inline constexpr double kPixelCentre = 0.5;

/// A square of the specimen's plane. It owns the pixels x0 … x1 − 1 and y0 … y1 − 1 by their
/// centres, so in coordinates it covers [x0 + ½, x1 + ½) × [y0 + ½, y1 + ½).
struct Square {
  std::int64_t x0 = 0, y0 = 0, size = 0;
  std::int64_t x1() const { return x0 + size; }
  std::int64_t y1() const { return y0 + size; }
  bool operator==(const Square&) const = default;
};

/// Returns quarter 0 … 3 of a square, x fastest.
Square quarter_of(const Square& square, int quarter);

/// A node of the tree: a root cell or one of four quarters of its parent.
struct QuadtreeNode {
  Square square;
  Region region = Region::kInterest;
  int level = 0;         ///< 0 for a root cell
  int parent = -1;       ///< node number, or −1 for a root cell
  int first_child = -1;  ///< first of four consecutive nodes, x fastest, or −1 for a leaf
  bool is_leaf() const { return first_child < 0; }
};

/// The arrangement of root cells, which tile the domain; sizes are in pixels. Every square's side
/// must be a multiple of the slab's 16 rows, so that a slab never straddles two leaves in y.
struct RootGrid {
  std::int64_t x0 = 0, y0 = 0;
  std::int64_t cell_size = 0;
  int columns = 0, rows = 0;
  bool operator==(const RootGrid&) const = default;
};

/// A tiling of the domain by equal root cells, each of which is a quadtree. Leaves are numbered in
/// the order of leaves(). A band is a row of root cells, and no leaf spans two bands.
class Quadtree {
 public:
  Quadtree() = default;
  /// Makes one leaf a root cell; region_of[row * columns + column] is its region.
  Quadtree(const RootGrid& roots, const std::vector<Region>& region_of);
  /// Makes a tree from the nodes of a model file. Throws Error if they are not a tree over `roots`.
  Quadtree(const RootGrid& roots, std::vector<QuadtreeNode> nodes);

  const RootGrid& roots() const { return roots_; }
  const std::vector<QuadtreeNode>& nodes() const { return nodes_; }
  /// Returns the node numbers of the leaves: bands in order, depth first within a band.
  const std::vector<int>& leaves() const { return leaves_; }
  const QuadtreeNode& leaf(int index) const {
    return nodes_[static_cast<std::size_t>(leaves_[index])];
  }
  int num_leaves() const { return static_cast<int>(leaves_.size()); }
  int band_of_leaf(int index) const;
  /// Returns the leaf number of a node, or −1 for inner nodes.
  int leaf_of_node(int node) const { return leaf_of_node_[static_cast<std::size_t>(node)]; }

  /// Replaces a leaf by its four quarters. Leaf numbers change: call leaves() again.
  void split(int leaf_index);
  /// Splits every leaf of `region` until its level is `level`.
  void split_to_level(Region region, int level);

  /// Returns the leaves whose square meets rows [y0, y1), ordered by x.
  std::vector<int> leaves_across(std::int64_t y0, std::int64_t y1) const;
  /// The coordinates that a square owns. The domain's first squares begin half a pixel earlier than
  /// their vertices, with the first pixel.
  struct Bounds {
    double x0, y0, x1, y1;
  };
  Bounds bounds(const Square& square) const;
  /// Returns the leaf that contains a point, or −1 outside the domain.
  int find_leaf(double x, double y) const;

 private:
  void add_children(int node);
  void number_leaves();

  RootGrid roots_;
  std::vector<QuadtreeNode> nodes_;
  std::vector<int> leaves_;        // node of each leaf
  std::vector<int> leaf_of_node_;  // leaf of each node, −1 for inner nodes
};

}  // namespace tomofield::field
