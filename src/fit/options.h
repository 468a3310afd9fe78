#pragma once

#include "objective/options.h"

namespace tomofield::fit {

/// The resolution of the leaves of a field. Lengths are pixels of the binned view.
struct FieldOptions {
  FieldKind kind = FieldKind::kVm;
  int leaf_size = 32;                  ///< side of a leaf, a multiple of 16
  TreeKind tree = TreeKind::kUniform;  ///< an adaptive tree splits and merges leaves during the fit
  int depth = 1;                ///< levels from a root cell to the first leaves; 0 in the margin
  int leaf_budget = 0;          ///< max. leaves of an adaptive tree; 0: as many as at the start
  double vertex_spacing = 1.0;  ///< between vertices of a leaf of leaf_size, on all axes
  int rank = 24;                ///< components of each mode (vm)
  bool with_margin = true;      ///< also model the specimen outside the region of interest
  double margin_spacing = 2.0;  ///< between samples and between vertices of the margin
  int margin_rank = 8;
  Activation activation = Activation::kSoftplus;
  double sharpness = 5.0;      ///< β of softplus, per density unit
  double initial_scale = 0.1;  ///< factors start uniform in ± this

  /// Returns the spacing of vertices in the smallest leaves.
  double finest_spacing() const { return vertex_spacing / (tree == TreeKind::kAdaptive ? 2 : 1); }
};

/// The weights of the loss and the schedule of a fit.
struct FitOptions : objective::ObjectiveOptions {
  int epochs = 30;  ///< at full resolution, with the kind of field that was asked for
  /// Epochs of a stage before the last one, whose plain vertices then become factors; 0: none.
  int vertex_epochs = 0;
  int coarse_epochs = 0;  ///< of the stages before these, on binned views; 0: none
  int coarse_bin = 4;     ///< max. bin of a coarse stage on each axis; a power of two
  Engine engine = Engine::kSlab;
  double learning_rate = 0.05;  ///< first learning rate; it decays exponentially
  // The rates below are factors of learning_rate.
  double final_rate = 0.1;         ///< at the end of the fit
  double coarse_final_rate = 0.3;  ///< at the end of a coarse stage
  double refined_rate = 0.5;       ///< at the start of a stage that follows a coarse one
  double vertex_rate = 0.7;        ///< multiplies the rates of plain vertices that become factors
  double factorised_rate = 0.3;    ///< at the start of factors that were plain vertices
  /// After each epoch, a plain vertex is at most the one of this rank around it; 0: no limit.
  int spike_rank = 3;
  bool fit_noise = true;  ///< weight views by their residuals, and limit these
  NoiseModel noise_model = NoiseModel::kWhite;
  bool fit_view_scale = false;  ///< fit a scale and an offset of every view
  int hold_out = 0;             ///< keep every Nth view from the fit; 0: none
  bool scores_epochs = true;    ///< score the held-out views after each epoch
  int patience = 0;  ///< stop after this many epochs without a better held-out error; 0: never
  Prior prior = Prior::kTv;  ///< see can_have_learned_prior()
  int num_stages = 0;        ///< of stages.h, from the first one on; 0: all
};

/// Returns the usual side of a leaf. Plain vertices express as much in larger leaves, which have
/// fewer faces and can be fitted with coarser pixels first.
inline int usual_leaf_size(const FieldOptions& field) {
  return field.kind == FieldKind::kGrid && field.tree == TreeKind::kUniform ? 64 : 32;
}

/// Returns the usual number of levels from a root cell down to a leaf. A root cell is also a band
/// of rows, which one thread works on, and a leaf of the margin. Large leaves of a uniform tree are
/// root cells themselves.
inline int usual_depth(const FieldOptions& field) {
  return field.tree == TreeKind::kUniform && field.leaf_size >= 64 ? 0 : 1;
}

}  // namespace tomofield::fit
