#pragma once

#include "objective/options.h"

namespace tomofield::fit {

/// How finely the leaves of a field resolve the specimen. Lengths are pixels of the binned view.
struct FieldOptions {
  FieldKind kind = FieldKind::kVm;
  int leaf_size = 32;                  ///< side of a leaf, a multiple of 16
  TreeKind tree = TreeKind::kUniform;  ///< adaptive: leaves half and twice as wide where that pays
  int depth = 1;                ///< levels from a root cell to the first leaves; 0 in the margin
  int leaf_budget = 0;          ///< most leaves of an adaptive tree; 0: as many as at the start
  double vertex_spacing = 1.0;  ///< between vertices on all axes, in leaves of that size
  int rank = 24;                ///< components of each mode (vm)
  bool with_margin = true;      ///< model the specimen outside the region of interest, too
  double margin_spacing = 2.0;  ///< between samples and between vertices of the margin
  int margin_rank = 8;
  Activation activation = Activation::kSoftplus;
  double sharpness = 5.0;      ///< β of softplus, per density unit
  double initial_scale = 0.1;  ///< factors start uniform in ± this

  /// Returns the spacing of vertices in the smallest leaves.
  double finest_spacing() const { return vertex_spacing / (tree == TreeKind::kAdaptive ? 2 : 1); }
};

/// How a field is fitted: the weights of the loss and the schedule.
struct FitOptions : objective::ObjectiveOptions {
  int epochs = 30;        ///< at full resolution, with the kind of field that was asked for
  int vertex_epochs = 0;  ///< before them with plain vertices, which are then factorised
  int coarse_epochs = 0;  ///< before all of these on binned views; 0: none
  int coarse_bin = 4;     ///< coarsest pixels on each axis, at most; a power of two
  Engine engine = Engine::kSlab;
  double learning_rate = 0.05;     ///< decays exponentially to learning_rate · final_rate
  double final_rate = 0.1;         ///< at the end of the fit, as a part of the first rate
  double coarse_final_rate = 0.3;  ///< at the end of a coarse stage, likewise
  double refined_rate = 0.5;       ///< at the start of a stage after a coarse one, likewise
  double vertex_rate = 0.7;        ///< of plain vertices that are to be factorised, likewise
  double factorised_rate = 0.3;    ///< at the start of factors made of vertices, likewise
  bool fit_view_scale = false;     ///< fit a scale and an offset of every view as nuisances
  int hold_out = 0;                ///< keep every Nth view from the fit; 0: none
  int patience = 0;  ///< epochs without a better held-out error before the fit stops; 0: never
};

/// Returns the usual side of a leaf. Plain vertices express as much in larger leaves, which have
/// fewer faces and can be fitted with coarser pixels first.
inline int usual_leaf_size(const FieldOptions& field) {
  return field.kind == FieldKind::kGrid && field.tree == TreeKind::kUniform ? 64 : 32;
}

/// Returns the usual number of levels from a root cell down to a leaf. A root cell is also a band
/// of rows, which one thread works at, and a leaf of the margin. Large leaves of a uniform tree are
/// root cells themselves.
inline int usual_depth(const FieldOptions& field) {
  return field.tree == TreeKind::kUniform && field.leaf_size >= 64 ? 0 : 1;
}

}  // namespace tomofield::fit
