#pragma once

#include "tomofield/options.h"

namespace tomofield::fit {

// The learning rate decays exponentially in each stage. Its first and last values are these factors
// of FitOptions::learning_rate.
inline constexpr double kFinalRate = 0.1;        ///< at the end of the fit
inline constexpr double kCoarseFinalRate = 0.3;  ///< at the end of a coarse stage
inline constexpr double kRefinedRate = 0.5;  ///< at the start of a stage that follows a coarse one
inline constexpr double kVertexRate = 0.7;   ///< all rates of vertices that become factors
inline constexpr double kFactorisedRate = 0.3;  ///< at the start of factors that were vertices

inline constexpr int kMarginRank = 8;  ///< of the factors of the margin

/// How the parameters of a field start.
struct FieldStart {
  double sharpness = 5.0;      ///< β of softplus, per density unit
  double initial_scale = 0.1;  ///< factors start uniform in ± this
};

/// Returns the usual side of a leaf. Plain vertices express as much in larger leaves, which have
/// fewer faces and can be fitted with coarser pixels first.
inline int usual_leaf_size(const FieldOptions& field) {
  return field.kind == FieldKind::kGrid && field.tree == TreeKind::kUniform ? 64 : 32;
}

/// Returns the number of levels from a root cell down to a first leaf of the region of interest. A
/// root cell is also a band of rows, which one thread works on, and a leaf of the margin. Large
/// leaves of a uniform tree are root cells themselves.
inline int depth_of(const FieldOptions& field) {
  return field.tree == TreeKind::kUniform && field.leaf_size >= 64 ? 0 : 1;
}

}  // namespace tomofield::fit
