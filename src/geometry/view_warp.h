#pragma once

#include <array>

namespace tomofield::geometry {

/// Describes local motion in a view by a smooth field of displacements d. After the view's
/// RawFromAligned is undone, the pixel at q shows what belongs at q + d(q), in pixels relative to
/// the image's centre.
///
/// The field goes through nodes that divide the view into 4 × 4 equal cells; the outer ones lie on
/// the view's edges. Between nodes it is the product of cubic Hermite splines in x and y whose
/// slope at a node is half the difference of its neighbours, and at an edge the difference to the
/// only neighbour. Outside the view, d is that of the nearest point on the edge.
struct ViewWarp {
  static constexpr int kNodes = 5;  ///< along each side
  using Vector = std::array<double, 2>;
  using Weights = std::array<double, kNodes>;
  using Rows = std::array<std::array<Vector, kNodes>, kNodes>;

  double width_px = 0.0;
  double height_px = 0.0;
  /// Displacements (x, y) in pixels, rows of equal y one after the other, from the smallest y and
  /// x on.
  std::array<Vector, kNodes * kNodes> nodes{};

  /// Returns the place of a node relative to the view's centre.
  Vector node_place(int row, int column) const {
    return {(static_cast<double>(column) / (kNodes - 1) - 0.5) * width_px,
            (static_cast<double>(row) / (kNodes - 1) - 0.5) * height_px};
  }
  /// Returns the displacements of the nodes, [row][column].
  Rows rows() const;
  /// Returns the warp of a view of this size whose nodes have these displacements.
  static ViewWarp from_rows(double width_px, double height_px, const Rows& rows);
  /// Returns d at a place relative to the view's centre.
  Vector displacement(double x, double y) const;
  /// Returns a length that neither component of any displacement exceeds.
  double largest_component() const;
  /// Returns the place q whose pixel shows what belongs at (x, y): q + d(q) = (x, y).
  Vector source_of(double x, double y) const;
  /// Returns the warp that makes this one first and then `next`, which refers to the view in which
  /// the motion of this one is undone. It is exact at the nodes.
  ViewWarp then(const ViewWarp& next) const;
  /// Returns the same warp in pixels that are `factor` times larger.
  ViewWarp binned(double factor) const;
  /// Returns the mean square of the displacements over the view, x and y together.
  double mean_square() const;

  /// Describes the displacements shift + m q + φ (−q_y, q_x).
  struct Rigid {
    Vector shift{};
    double magnification = 0.0, rotation = 0.0;  // m and φ
  };
  /// Returns the rigid displacements that are nearest to these over the view in least squares.
  Rigid rigid_part() const;
  /// Returns the warp less rigid displacements. In the view this is exact.
  ViewWarp without(const Rigid& part) const;

  /// Returns the weights of the nodes at a position along one side, from −1/2 to 1/2 of its length.
  static Weights node_weights(double position);

  bool operator==(const ViewWarp&) const = default;
};

}  // namespace tomofield::geometry
