#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "field/field.h"
#include "tomofield/options.h"

namespace tomofield::field {

/// A field of vector–matrix factors (eq. 4). The parameters of a leaf are, in this order,
///
///   VX [nx, Rx]      MYZ [nz, ny, Rx]
///   VY [ny, Ry]      MXZ [nx, nz, Ry]
///   VZ [nz, Rz]      MXY [nx, ny, Rz]
///
///   value(x, y, z) = Σ_r VX(x) MYZ(y, z) + Σ_r VY(y) MXZ(x, z) + Σ_r VZ(z) MXY(x, y)
///
/// The rank is innermost, so that interpolation and gradients run over contiguous ranks. A slab
/// costs 3R FMAs a vertex and row forward and 6R back, all of them small matrix products.
class VmField final : public Field {
 public:
  VmField(Quadtree tree, double thickness, std::vector<LeafShape> shapes)
      : Field(std::move(tree), thickness, std::move(shapes)) {
    allocate();
  }

  /// Returns the number of parameters of a leaf.
  static std::size_t count(const LeafShape& shape);

  FieldKind kind() const override { return FieldKind::kVm; }
  void slab_gradient(int leaf, const LaneRows& rows, const float* grad_values,
                     float* gradient) const override;
  double parameter_variation(int leaf, const kernels::VariationPenalty& penalty, double weight,
                             float* gradient) const override;
  void limit_spikes(int, int) override {}

 protected:
  std::size_t parameter_count(const LeafShape& shape) const override { return count(shape); }
  std::vector<ParameterRuns> runs_of_rows(const LeafShape& shape, int first_y,
                                          int end_y) const override;
  void add_slab_values(int leaf, const LaneRows& rows, float* values) const override;
  void add_row_values(int leaf, int lower, float fraction, float* values) const override;
  void add_point_values(int leaf, const PointTaps& taps, float* values) const override;
  void add_point_gradient(int leaf, const PointTaps& taps, const float* grad_values,
                          float* gradient) const override;
  void sample_quarter(const LeafShape& shape, const float* leaf, double x0, double y0,
                      float* quarter) const override;
  void resample_leaf(const LeafShape& from_shape, const float* from, const LeafShape& to_shape,
                     float* to) const override;
  void join_leaves(const LeafShape& shape, const Quarters& leaves, float* joined) const override;
  void fit_merged(const LeafShape& shape, const MergeTarget& target,
                  float* parameters) const override;
};

/// The offsets of the six factors in a leaf's parameters.
struct VmLayout {
  std::size_t vx, myz, vy, mxz, vz, mxy, count;
  explicit VmLayout(const LeafShape& s) {
    const auto size = [](int a, int b, int c) { return static_cast<std::size_t>(a) * b * c; };
    vx = 0;
    myz = vx + size(s.nx, 1, s.rank_x);
    vy = myz + size(s.nz, s.ny, s.rank_x);
    mxz = vy + size(s.ny, 1, s.rank_y);
    vz = mxz + size(s.nx, s.nz, s.rank_y);
    mxy = vz + size(s.nz, 1, s.rank_z);
    count = mxy + size(s.nx, s.ny, s.rank_z);
  }
};

}  // namespace tomofield::field
