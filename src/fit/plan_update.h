#pragma once

#include <vector>

#include "field/tree/quadtree_edit.h"

namespace tomofield::fit {

/// Limits the changes of a tree and says how they change the errors of its leaves.
struct PlanOptions {
  int budget = 0;              ///< max. number of leaves of the region of interest
  int min_size = 16;           ///< min. side of a leaf, px; sides stay multiples of a slab anyway
  double split_factor = 0.75;  ///< predicted error of four quarters over that of their leaf
  double merge_factor = 1.1;   ///< predicted error of a merged leaf over the sum of the four
};

/// The changes of a tree, and the errors that they are predicted to leave.
struct Plan {
  field::QuadtreeEdit edit;
  double predicted_error = 0.0;  ///< sum over the leaves of the region of interest after the edit
};

/// Decides for each leaf of the region of interest whether it is split, kept, or merged with its
/// siblings. The plan has the smallest sum of predicted errors within the budget; it solves a
/// mixed-integer program (Martel et al. 2021, ACORN) to optimality. Where one edit cannot reach the
/// budget, the plan comes as close as it can. It makes no change that gains nothing, and none
/// outside the region of interest. `errors` has one entry for each leaf, 0 or more. The same
/// arguments give the same plan.
Plan plan_update(const field::Quadtree& tree, const std::vector<double>& errors,
                 const PlanOptions& options);

}  // namespace tomofield::fit
