#pragma once

#include <cstdint>
#include <vector>

namespace tomofield::field {

/// Part of the domain a root cell belongs to: the region that is asked for, or
/// the margin around it that rays cross on their way.
enum class Region : std::uint8_t { kInterest, kMargin };

/// Pixel i of the aligned view at zero tilt covers [i, i + 1) and has its centre
/// half a pixel on. Faces of squares, and with them vertices at a spacing of one
/// pixel, lie on centres of pixels: there the samples of a fit read single
/// vertices, where between them they would see means of eight, whose sharp
/// detail the fit recovers slowly (docs/results/ablation.md).
inline constexpr double kPixelCentre = 0.5;

/// A square of the specimen's plane that owns the pixels (centres) x0 … x1 − 1
/// and y0 … y1 − 1: in coordinates [x0 + ½, x1 + ½) × [y0 + ½, y1 + ½).
struct Square {
  std::int64_t x0 = 0, y0 = 0, size = 0;
  std::int64_t x1() const { return x0 + size; }
  std::int64_t y1() const { return y0 + size; }
  bool operator==(const Square&) const = default;
};

/// Quarter 0 … 3 of a square, x fastest.
Square quarter_of(const Square& square, int quarter);

struct QuadtreeNode {
  Square square;
  Region region = Region::kInterest;
  int level = 0;         ///< 0 is a root cell
  int parent = -1;       ///< node, or −1 for a root cell
  int first_child = -1;  ///< four consecutive nodes, x fastest, or −1 for a leaf
  bool is_leaf() const { return first_child < 0; }
};

/// How root cells tile the domain. Every square's side must stay a multiple of
/// the slab's 16 rows, so that a slab never straddles two leaves in y.
struct RootGrid {
  std::int64_t x0 = 0, y0 = 0;
  std::int64_t cell_size = 0;
  int columns = 0, rows = 0;
  bool operator==(const RootGrid&) const = default;
};

/// Equal root cells over the domain, each a quadtree. Leaves are numbered in
/// the order of leaves(); a band is a row of root cells, and no leaf spans two bands.
class Quadtree {
 public:
  Quadtree() = default;
  /// One leaf a root cell; `region_of[row * columns + column]` says what each is part of.
  Quadtree(const RootGrid& roots, const std::vector<Region>& region_of);
  /// From stored nodes (a model file); throws Error if they are not a tree over `roots`.
  Quadtree(const RootGrid& roots, std::vector<QuadtreeNode> nodes);

  const RootGrid& roots() const { return roots_; }
  const std::vector<QuadtreeNode>& nodes() const { return nodes_; }
  /// Node numbers of the leaves: bands in order, within a band depth first.
  const std::vector<int>& leaves() const { return leaves_; }
  const QuadtreeNode& leaf(int index) const {
    return nodes_[static_cast<std::size_t>(leaves_[index])];
  }
  int num_leaves() const { return static_cast<int>(leaves_.size()); }
  int band_of_leaf(int index) const;
  /// Leaf number of a node, −1 for inner nodes.
  int leaf_of_node(int node) const { return leaf_of_node_[static_cast<std::size_t>(node)]; }

  /// Replaces a leaf by its four quarters. Leaf numbers change: call leaves() again.
  void split(int leaf_index);
  /// Splits every leaf of `region` until its level is `level`.
  void split_to_level(Region region, int level);

  /// Leaves whose square meets rows [y0, y1), ordered by x.
  std::vector<int> leaves_across(std::int64_t y0, std::int64_t y1) const;
  /// Coordinates that a square owns; those of the domain's first ones begin half a
  /// pixel early, with the first pixel.
  struct Bounds {
    double x0, y0, x1, y1;
  };
  Bounds bounds(const Square& square) const;
  /// The leaf that holds a point, or −1 outside the domain.
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
