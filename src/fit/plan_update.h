#pragma once

#include <vector>

#include "field/tree/quadtree_edit.h"

namespace tomofield::fit {

struct PlanOptions {
  int budget = 0;              ///< most leaves of the region of interest
  int min_size = 16;           ///< of a leaf, px; sides stay multiples of a slab in any case
  int coarsest_level = 0;      ///< no leaf becomes larger than this level's
  double split_factor = 0.75;  ///< predicted error of four quarters, of their leaf's
  double merge_factor = 1.1;   ///< predicted error of a merged leaf, of the sum of the four
};

struct Plan {
  field::QuadtreeEdit edit;
  double predicted_error = 0.0;  ///< Σ over the leaves of the region of interest
};

/// Splits, keeps or merges with its siblings each leaf of the region of interest so
/// that the sum of predicted errors is least and the leaves are within the
/// budget: a mixed-integer program (Martel et al. 2021, ACORN), solved to
/// optimality. Leaves elsewhere are left alone. Where no single edit reaches the
/// budget it comes as close as it can. Changes that gain nothing are not made.
/// `errors` is one a leaf, 0 or more; pure and deterministic.
Plan plan_update(const field::Quadtree& tree, const std::vector<double>& errors,
                 const PlanOptions& options);

}  // namespace tomofield::fit
