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
#include "field/tree/quadtree.h"
#include "field/tree/quadtree_edit.h"
#include "field/vm/join_quarters.h"
#include "kernels/lanes.h"
#include "kernels/leaf_decoding.h"
#include "kernels/total_variation.h"
#include "tomofield/options.h"

namespace tomofield::field {

/// Vertices of a leaf on each axis, both faces included, and the ranks of its
/// three modes (0 for fields that are not factorised).
struct LeafShape {
  int nx = 0, ny = 0, nz = 0;
  int rank_x = 0, rank_y = 0, rank_z = 0;  ///< of VX⊗MYZ, VY⊗MXZ, VZ⊗MXY
  bool operator==(const LeafShape&) const = default;
  static constexpr int kMostVertices = 1 << 16;  ///< along an axis
  std::size_t vertices_xz() const { return static_cast<std::size_t>(nx) * nz; }
};

/// 16 positions in y as one leaf sees them: lane l interpolates y vertices
/// lower[l] and lower[l] + 1 with weight fraction[l] on the upper one.
struct LaneRows {
  std::array<int, kernels::kLanes> lower{};
  std::array<float, kernels::kLanes> fraction{};

  /// Whether the lanes lie between neighbouring vertices, each a vertex further than the one
  /// before; and whether, of such lanes, lane l is at vertex lower[0] + l.
  bool are_a_vertex_apart() const;
  bool are_at_neighbouring_vertices() const;
};

/// Points in the field's coordinates (pixels): spans of one length.
struct Points {
  std::span<const double> x, y, z;
  std::size_t size() const { return x.size(); }
};

/// The same points between the vertices of one leaf.
struct PointTaps {
  kernels::AxisTaps x, y, z;
  int count() const { return x.count; }
};

/// Some parameters of a leaf: `repeats` times `count` of them, `stride` apart, from the leaf's
/// `first` on.
struct ParameterRuns {
  std::size_t first = 0, count = 0, stride = 0, repeats = 1;
  std::size_t size() const { return count * repeats; }
};

struct MergeTarget;

/// A density field over a quadtree: vertex values a leaf at a time, and the
/// gradient back to the parameters. Everything above this folder sees a field
/// through this interface alone. Coordinates are pixels of the aligned view at
/// zero tilt; z runs over [0, thickness). Densities are
/// act(trilinear interpolation of vertex values), vertex values Σ… + bias (eq. 4).
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

  /// All parameters, leaf by leaf; [offset(leaf), offset(leaf + 1)) are a leaf's own.
  std::span<float> parameters() { return parameters_; }
  std::span<const float> parameters() const { return parameters_; }
  std::size_t offset(int leaf) const { return offsets_[static_cast<std::size_t>(leaf)]; }
  std::size_t num_parameters() const { return offsets_.back(); }

  /// The decoder: its linear layer has weights 1 (else the factors' total
  /// variation could be evaded by scaling) and this bias; then the activation.
  float bias = 0.0f;
  kernels::Activation activation;

  /// Position among the vertices of an axis of `leaf`; those in z lie between the
  /// centres of the first and the last pixel of the thickness.
  double vertex_x(int leaf, double x) const;
  double vertex_y(int leaf, double y) const;
  double vertex_z(int leaf, double z) const;
  LaneRows lane_rows(int leaf, std::span<const double, kernels::kLanes> y) const;

  /// The parameters of a leaf that its values at positions y from `low` to `high` depend on.
  std::vector<ParameterRuns> parameters_between(int leaf, double low, double high) const;

  /// Vertex values of a leaf at 16 rows: values[x, z, lane], overwritten.
  void slab_values(int leaf, const LaneRows& rows, float* values) const;
  /// Adds dL/d parameters of this leaf, given dL/d values, to gradient[0 … count).
  virtual void slab_gradient(int leaf, const LaneRows& rows, const float* grad_values,
                             float* gradient) const = 0;
  /// Vertex values at a single row: values[x, z], overwritten.
  void row_values(int leaf, double y, float* values) const;
  /// Densities of one leaf at points in it, overwritten. The leaf is given, so that
  /// both sides of a shared face can be asked for; points beyond it take the
  /// nearest face's value. Interpolated in float, ranks in vectors.
  void point_densities(int leaf, const Points& points, std::span<float> densities) const;
  /// Adjoint of point_densities at the densities that it gave: adds dL/d parameters
  /// of this leaf to gradient[0 … count) and returns dL/d bias.
  double point_gradient(int leaf, const Points& points, std::span<const float> densities,
                        std::span<const float> grad_densities, float* gradient) const;
  /// Density at a point; 0 outside the domain.
  double density(double x, double y, double z) const;

  /// Total variation of the parameters themselves (eq. 5): its value, and its
  /// gradient added to gradient[0 … count).
  virtual double parameter_variation(int leaf, const kernels::VariationPenalty& penalty,
                                     double weight, float* gradient) const = 0;

  /// Starting values, uniform in ± scale: every density close to act(bias).
  void initialise(base::Random random, double scale);

  /// Of a field that several processes share: only these leaves, or all if there are none, are
  /// asked for here. The parameters of others are zeros that are never written, and so take no
  /// memory.
  void keep_only(const std::vector<int>& leaves);
  bool keeps(int leaf) const {
    return is_kept_.empty() || is_kept_[static_cast<std::size_t>(leaf)];
  }

  /// The same field on the same tree with other vertices: every factor interpolated along
  /// its axes. Nothing is lost where a leaf's vertices contain those that it had, as
  /// with k (n − 1) + 1 for n. One shape a leaf, of the same ranks.
  std::unique_ptr<Field> resampled(std::vector<LeafShape> shapes) const;

  /// Changes the tree, and with it the leaves' numbers and parameters. Every leaf keeps
  /// its vertex counts, so that a leaf half as wide is twice as fine (DESIGN §1). A
  /// split leaves the field as it is to rounding; a merge is the least-squares fit
  /// to the vertex values of the four. `moments` go with the parameters, one value
  /// each, and are carried along by maps of positive weights. Returns what each leaf was.
  std::vector<LeafOrigin> edit(const QuadtreeEdit& edit,
                               const std::vector<base::AlignedBuffer<float>*>& moments = {});

 protected:
  virtual std::size_t parameter_count(const LeafShape& shape) const = 0;
  /// The parameters of vertices [first_y, end_y) along y.
  virtual std::vector<ParameterRuns> runs_of_rows(const LeafShape& shape, int first_y,
                                                  int end_y) const = 0;
  virtual void add_slab_values(int leaf, const LaneRows& rows, float* values) const = 0;
  virtual void add_row_values(int leaf, int lower, float fraction, float* values) const = 0;
  /// values[point] += vertex values interpolated there, without the bias; and its adjoint.
  virtual void add_point_values(int leaf, const PointTaps& taps, float* values) const = 0;
  virtual void add_point_gradient(int leaf, const PointTaps& taps, const float* grad_values,
                                  float* gradient) const = 0;
  /// Parameters of the quarter [x0, x0 + ½] × [y0, y0 + ½] (fractions of the leaf) of a leaf.
  virtual void sample_quarter(const LeafShape& shape, const float* leaf, double x0, double y0,
                              float* quarter) const = 0;
  /// A leaf's parameters at other vertices.
  virtual void resample_leaf(const LeafShape& from_shape, const float* from,
                             const LeafShape& to_shape, float* to) const = 0;
  /// join_quarters() of every factor.
  virtual void join_leaves(const LeafShape& shape, const Quarters& leaves, float* joined) const = 0;
  /// Least-squares parameters of a merged leaf; `parameters` hold where to start.
  virtual void fit_merged(const LeafShape& shape, const MergeTarget& target,
                          float* parameters) const = 0;

  const float* leaf_parameters(int leaf) const { return parameters_.data() + offset(leaf); }
  /// Fixes the parameter layout; derived constructors call it.
  void allocate();

 private:
  PointTaps point_taps(int leaf, const Points& points) const;
  void carry_leaf(const LeafOrigin& origin, const float* from, float* to) const;

  Quadtree tree_;
  double thickness_;
  std::vector<LeafShape> shapes_;
  std::vector<std::size_t> offsets_;
  std::vector<char> is_kept_;  // of each leaf; empty: all are
  base::AlignedBuffer<float> parameters_;
};

/// Length in z that vertices span: from the centre of the first pixel to that of the
/// last, or a pixel for specimens thinner than two.
double vertex_height(double thickness);

/// Parameters that make_field would allocate.
std::size_t count_parameters(FieldKind kind, const std::vector<LeafShape>& shapes);

/// Makes a field whose parameters are all zero.
std::unique_ptr<Field> make_field(FieldKind kind, Quadtree tree, double thickness,
                                  std::vector<LeafShape> shapes);

}  // namespace tomofield::field
