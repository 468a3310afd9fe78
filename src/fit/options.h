#pragma once

#include "tomofield/options.h"

#include <cstdint>
#include <string>
#include <vector>

namespace tomofield::fit {

/// The field: how finely leaves resolve the specimen. Lengths in pixels of the binned view.
struct FieldOptions {
  FieldKind kind = FieldKind::kVm;
  int leaf_size = 32;                  ///< side of a leaf, a multiple of 16
  TreeKind tree = TreeKind::kUniform;  ///< adaptive: leaves half and twice as wide where that pays
  int depth = 1;                       ///< of leaves as they are first; those of the margin have 0
  int leaf_budget = 0;          ///< most leaves of an adaptive tree; 0: as many as it begins with
  double vertex_spacing = 1.0;  ///< between vertices, all axes; of leaves of that size
  int rank = 24;                ///< of each mode, vm only
  bool with_margin = true;      ///< model what rays cross outside the region of interest
  double margin_spacing = 2.0;  ///< of samples and vertices there
  int margin_rank = 8;
  Activation activation = Activation::kSoftplus;
  double sharpness = 5.0;      ///< β of softplus, per density unit
  double initial_scale = 0.1;  ///< factors start uniform in ± this
  /// Between vertices of the smallest leaves.
  double finest_spacing() const { return vertex_spacing / (tree == TreeKind::kAdaptive ? 2 : 1); }
  /// Every fault of these options, a sentence each.
  std::vector<std::string> faults() const;
};

/// The optimisation. The data term is ½ Σ (residual / σ)²; weights of
/// variations are relative to it and to the noise: weight / σ is used, with σ
/// the typical noise of a ray in density units times pixels (and a gain where σ is small,
/// noise_scale.h).
struct FitOptions {
  int epochs = 30;        ///< at full resolution, of the field as it will be
  int vertex_epochs = 0;  ///< before them, of plain vertices that factors begin with
  int coarse_epochs = 0;  ///< before all, with fewer pixels; 0: none
  int coarse_bin = 4;     ///< how many times fewer on each axis, at most; a power of two
  int subsets = 16;       ///< interleaved tilt subsets: steps an epoch; at most one a view
  Engine engine = Engine::kSlab;
  int ray_samples = 0;             ///< N_max of eq. 10; 0: one a pixel of a leaf's diagonal
  std::int64_t rays_per_step = 0;  ///< about; 0: all rays of an epoch over `subsets`
  double learning_rate = 0.05;     ///< falls exponentially to learning_rate · final_rate
  double final_rate = 0.1;
  double coarse_final_rate = 0.3;   ///< of a coarse stage
  double refined_rate = 0.5;        ///< where a stage starts after a coarse one
  double vertex_rate = 0.7;         ///< of plain vertices that factors begin with
  double factorised_rate = 0.3;     ///< where these factors start
  double density_variation = 14.0;  ///< see usual_variation
  double factor_variation = 0.0;
  double boundary = 4.0;  ///< boundary consistency of leaves (eq. 6)
  double fourier = 0.0;   ///< isotropic Fourier prior (eq. 7)
  RingReference fourier_ring = RingReference::kMean;
  Penalty penalty = Penalty::kConcave;  ///< of both variations
  double concavity = 0.4;               ///< τ of the concave penalty, in units of a voxel's noise
  double gradient_floor = 1e-3;         ///< ε of both penalties, in density units a pixel
  bool fit_view_scale = false;          ///< per-view scale and offset as nuisances
  std::uint64_t seed = 1;
  int hold_out = 0;  ///< keep every so-manieth view from the fit; 0: none
  int patience = 0;  ///< epochs without a better held-out error before it stops; 0: never
  std::vector<std::string> faults() const;
};

/// Side of a leaf, by the kind of field and its tree: plain vertices express as much in larger
/// leaves, which have fewer faces and can be fitted with coarser pixels first.
inline int usual_leaf_size(const FieldOptions& field) {
  return field.kind == FieldKind::kGrid && field.tree == TreeKind::kUniform ? 64 : 32;
}

/// Levels from a root cell down to a leaf. A root cell is also a band of rows, which one thread
/// works at, and a leaf of the margin: large leaves of a uniform tree are root cells themselves.
inline int usual_depth(const FieldOptions& field) {
  return field.tree == TreeKind::kUniform && field.leaf_size >= 64 ? 0 : 1;
}

/// The weight of the density's variation that goes with a penalty: a concave one counts
/// large steps less, and so needs more (docs/results/ablation.md).
inline double usual_variation(Penalty penalty) {
  return penalty == Penalty::kSmooth ? 5.0 : FitOptions{}.density_variation;
}

}  // namespace tomofield::fit
