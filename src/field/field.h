#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/aligned_buffer.h"
#include "base/random.h"
#include "field/sampling/resample.h"
#include "field/tree/quadtree.h"
#include "field/tree/quadtree_edit.h"
#include "kernels/lanes.h"
#include "kernels/leaf_decoding.h"
#include "kernels/total_variation.h"
#include "tomofield/options.h"

namespace tomofield::field {

/// The number of vertices of a leaf on each axis, both faces included, and the ranks of its three
/// modes (0 for fields that are not factorised).
struct LeafShape {
  int nx = 0, ny = 0, nz = 0;
  int rank_x = 0, rank_y = 0, rank_z = 0;  ///< ranks of VX⊗MYZ, VY⊗MXZ, VZ⊗MXY
  bool operator==(const LeafShape&) const = default;
  static constexpr int kMaxVertices = 1 << 16;  ///< along an axis
  std::size_t vertices_xz() const { return static_cast<std::size_t>(nx) * nz; }
};

/// The y positions of a slab's 16 rows among the vertices of one leaf. Lane l interpolates y
/// vertices lower[l] and lower[l] + 1 with weight fraction[l] on the upper one.
struct LaneRows {
  std::array<int, kernels::kLanes> lower{};
  std::array<float, kernels::kLanes> fraction{};

  /// Returns true if lane l lies between vertices lower[0] + l and lower[0] + l + 1, for every l.
  bool are_a_vertex_apart() const;
  /// Returns true if lane l is at vertex lower[0] + l, for every l.
  bool are_at_neighbouring_vertices() const;
};

/// Points in the field's coordinates (pixels); the three spans have the same length.
struct Points {
  std::span<const double> x, y, z;
  std::size_t size() const { return x.size(); }
};

/// Points placed between the vertices of one leaf.
struct PointTaps {
  kernels::AxisTaps x, y, z;
  int count() const { return x.count; }
};

/// Some parameters of a leaf: `repeats` runs of `count` parameters. The runs begin `stride` apart,
/// and the first one begins at `first`, counted from the leaf's own first parameter.
struct ParameterRuns {
  std::size_t first = 0, count = 0, stride = 0, repeats = 1;
  std::size_t size() const { return count * repeats; }
};

struct MergeTarget;

/// A density field over a quadtree. It computes vertex values, one leaf at a time, and the gradient
/// of its parameters. All code outside this folder uses a field through this interface alone.
///
/// Coordinates are pixels of the aligned view at zero tilt; z runs over [0, thickness). Densities
/// are act(trilinear interpolation of vertex values), and vertex values are Σ… + bias (eq. 4).
class Field {
 public:
  Field(Quadtree tree, double thickness, std::vector<LeafShape> shapes);
  virtual ~Field() = default;
  Field(const Field&) = delete;
  Field& operator=(const Field&) = delete;

  virtual FieldKind kind() const = 0;

  const Quadtree& tree() const { return tree_; }
  double thickness() const { return thickness_; }
  const LeafShape& shape(int leaf) const { return shapes_[static_cast<std::size_t>(leaf)]; }
  const std::vector<LeafShape>& shapes() const { return shapes_; }

  /// Returns all parameters, leaf by leaf. [offset(leaf), offset(leaf + 1)) belong to a leaf.
  std::span<float> parameters() { return parameters_; }
  std::span<const float> parameters() const { return parameters_; }
  std::size_t offset(int leaf) const { return offsets_[static_cast<std::size_t>(leaf)]; }
  std::size_t num_parameters() const { return offsets_.back(); }

  /// The decoder adds this bias and applies the activation. The weights of its linear layer are 1;
  /// otherwise scaling could evade the factors' total variation.
  float bias = 0.0f;
  kernels::Activation activation;

  /// Return a coordinate's position among the vertices of an axis of `leaf`. The vertices in z lie
  /// between the centres of the first and the last pixel of the thickness.
  double vertex_x(int leaf, double x) const;
  double vertex_y(int leaf, double y) const;
  double vertex_z(int leaf, double z) const;
  LaneRows lane_rows(int leaf, std::span<const double, kernels::kLanes> y) const;

  /// Returns the parameters of a leaf on which its values at positions y from `low` to `high`
  /// depend.
  std::vector<ParameterRuns> parameters_between(int leaf, double low, double high) const;

  /// Overwrites values[x, z, lane] with the vertex values of a leaf at 16 rows.
  void slab_values(int leaf, const LaneRows& rows, float* values) const;
  /// Adds dL/d parameters of this leaf, given dL/d values [x, z, lane], to gradient[0 … count).
  virtual void slab_gradient(int leaf, const LaneRows& rows, const float* grad_values,
                             float* gradient) const = 0;
  /// Overwrites values[x, z] with the vertex values at a single row.
  void row_values(int leaf, double y, float* values) const;
  /// Overwrites `densities` with the densities of one leaf at points in it. The caller gives the
  /// leaf, so that it can ask for both sides of a shared face. Points outside the leaf take the
  /// nearest face's value. Values are interpolated in float, with vectors of ranks.
  void point_densities(int leaf, const Points& points, std::span<float> densities) const;
  /// Applies the adjoint of point_densities at the densities that it returned: adds dL/d parameters
  /// of this leaf to gradient[0 … count) and returns dL/d bias.
  double point_gradient(int leaf, const Points& points, std::span<const float> densities,
                        std::span<const float> grad_densities, float* gradient) const;
  /// Returns the density at a point, and 0 outside the domain.
  double density(double x, double y, double z) const;

  /// Returns the total variation of the parameters themselves (eq. 5) and adds its gradient to
  /// gradient[0 … count).
  virtual double parameter_variation(int leaf, const kernels::VariationPenalty& penalty,
                                     double weight, float* gradient) const = 0;

  /// Moves vertices of a leaf that stand out from all but `rank` - 1 of their neighbours in the
  /// leaf back to these (kernels/spikes.h). A leaf of factors stays as it is.
  virtual void limit_spikes(int leaf, int rank) = 0;

  /// Sets random starting values, uniform in ± scale, which make every density close to act(bias).
  void initialise(base::Random random, double scale);

  /// Restricts a field that several ranks share: this rank then uses only `leaves`, or all if there
  /// are none. The parameters of other leaves are zeros that are never written, so they take no
  /// memory.
  void keep_only(const std::vector<int>& leaves);
  bool keeps(int leaf) const {
    return is_kept_.empty() || is_kept_[static_cast<std::size_t>(leaf)];
  }

  /// Returns the same field on the same tree with other vertices: every factor is interpolated
  /// along its axes. Nothing is lost if a leaf's new vertices contain the old ones, as with k (n −
  /// 1) + 1 for n. There must be one shape a leaf, with the same ranks.
  std::unique_ptr<Field> resampled(std::vector<LeafShape> shapes) const;

  /// Changes the tree, and with it the leaves' numbers and parameters. Returns the origin of each
  /// new leaf. Every leaf keeps its vertex counts, so that a leaf half as wide is twice as fine
  /// (docs/adaptive-tree.md). A split leaves the field unchanged to rounding. A merge is the
  /// least-squares fit to the vertex values of the four leaves. `moments` have one value a
  /// parameter and are carried along by maps of positive weights.
  std::vector<LeafOrigin> edit(const QuadtreeEdit& edit,
                               const std::vector<base::AlignedBuffer<float>*>& moments = {});

 protected:
  virtual std::size_t parameter_count(const LeafShape& shape) const = 0;
  /// Returns the parameters of vertices [first_y, end_y) along y.
  virtual std::vector<ParameterRuns> runs_of_rows(const LeafShape& shape, int first_y,
                                                  int end_y) const = 0;
  virtual void add_slab_values(int leaf, const LaneRows& rows, float* values) const = 0;
  virtual void add_row_values(int leaf, int lower, float fraction, float* values) const = 0;
  /// Adds the vertex values interpolated at each point, without the bias, to values[point].
  virtual void add_point_values(int leaf, const PointTaps& taps, float* values) const = 0;
  /// Applies the adjoint of add_point_values.
  virtual void add_point_gradient(int leaf, const PointTaps& taps, const float* grad_values,
                                  float* gradient) const = 0;
  /// Writes the parameters of a leaf's quarter [x0, x0 + ½] × [y0, y0 + ½], in fractions of the
  /// leaf.
  virtual void sample_quarter(const LeafShape& shape, const float* leaf, double x0, double y0,
                              float* quarter) const = 0;
  /// Writes a leaf's parameters at other vertices.
  virtual void resample_leaf(const LeafShape& from_shape, const float* from,
                             const LeafShape& to_shape, float* to) const = 0;
  /// Applies join_quarters() to every factor.
  virtual void join_leaves(const LeafShape& shape, const Quarters& leaves, float* joined) const = 0;
  /// Computes the least-squares parameters of a merged leaf; `parameters` hold the start.
  virtual void fit_merged(const LeafShape& shape, const MergeTarget& target,
                          float* parameters) const = 0;

  const float* leaf_parameters(int leaf) const { return parameters_.data() + offset(leaf); }
  float* leaf_parameters(int leaf) { return parameters_.data() + offset(leaf); }
  /// Fixes the parameter layout. The constructors of derived classes call it.
  void allocate();

 private:
  PointTaps point_taps(int leaf, const Points& points) const;
  void carry_leaf(const LeafOrigin& origin, const float* from, float* to) const;

  Quadtree tree_;
  double thickness_;
  std::vector<LeafShape> shapes_;
  std::vector<std::size_t> offsets_;
  std::vector<char> is_kept_;  // a flag for each leaf; empty if all leaves are kept
  base::AlignedBuffer<float> parameters_;
};

/// Returns the length in z that the vertices span, in pixels: from the centre of the first pixel to
/// that of the last, or one pixel for specimens thinner than two.
double vertex_height(double thickness);

/// Returns the number of parameters that make_field would allocate.
std::size_t count_parameters(FieldKind kind, const std::vector<LeafShape>& shapes);

/// Makes a field whose parameters are all zero.
std::unique_ptr<Field> make_field(FieldKind kind, Quadtree tree, double thickness,
                                  std::vector<LeafShape> shapes);

}  // namespace tomofield::field
