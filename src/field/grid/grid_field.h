#pragma once

#include <string>
#include <utility>
#include <vector>

#include "field/field.h"
#include "tomofield/options.h"

namespace tomofield::field {

/// The simplest field on the quadtree: its parameters are the vertex values themselves, V
/// [nx, nz, ny]. It is the yardstick for the factorised field.
class GridField final : public Field {
 public:
  GridField(Quadtree tree, double thickness, std::vector<LeafShape> shapes)
      : Field(std::move(tree), thickness, std::move(shapes)) {
    allocate();
  }

  /// Returns the number of parameters of a leaf.
  static std::size_t count(const LeafShape& shape);

  FieldKind kind() const override { return FieldKind::kGrid; }
  void slab_gradient(int leaf, const LaneRows& rows, const float* grad_values,
                     float* gradient) const override;
  double parameter_variation(int leaf, const kernels::VariationPenalty& penalty, double weight,
                             float* gradient) const override;
  void limit_spikes(int leaf, int rank) override;

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

}  // namespace tomofield::field
