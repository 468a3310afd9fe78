#pragma once

#include <cstdint>
#include <vector>

#include "field/field.h"
#include "fit/adam.h"
#include "fit/stages.h"
#include "tomofield/options.h"

namespace tomofield::fit {

/// Records one update of an adaptive tree, for the metrics.
struct TreeUpdate {
  std::int64_t epoch = 0;  ///< epochs done
  std::int64_t splits = 0, merges = 0;
  double error = 0.0;                         ///< sum of the leaves' errors before the update
  double predicted_error = 0.0;               ///< the sum that plan_update() predicts for after it
  std::vector<std::int64_t> leaves_by_level;  ///< leaves_by_level() after the update
};

/// The history of an adaptive tree, which is a part of a fit's progress.
struct TreeProgress {
  bool is_frozen = false;  ///< the tree changes no more
  std::vector<TreeUpdate> updates;
};

/// Returns the error of each leaf: the standard deviation of the density in it, in density units.
/// It is measured at random points, one in each of 8 × 8 × 16 equal boxes (x, y, z) of the leaf.
/// Leaves outside the region of interest get 0. The points depend on `seed`, `pass` and the leaf's
/// square alone; `pass` differs between updates.
std::vector<double> leaf_errors(const field::Field& field, std::uint64_t seed, std::uint64_t pass);

/// Splits and merges leaves of a field between two steps. The moments of the optimiser follow their
/// leaves. A quarter takes over the number of steps of the leaf that was split. A merged leaf takes
/// the smallest number of the four, so that its bias correction is the most careful one.
void apply_edit(const field::QuadtreeEdit& edit, field::Field& field, Adam::State& optimizer);

/// Returns after how many epochs a tree changes no more, in a fit that begins with stage `first`.
std::int64_t open_epochs(const FieldOptions& field, const Stage& first);
/// Tells whether the tree may change in such a fit.
bool tree_may_change(const FieldOptions& field, const Stage& first);

/// Updates an adaptive tree (Martel et al. 2021, ACORN). While the tree is open, every other epoch
/// ends with an update: it measures the leaves' errors, plans splits and merges (plan_update.h) and
/// applies them. The tree is frozen after the open epochs, or when a plan changes nothing.
class TreeUpdates {
 public:
  /// Keeps the tree open for `open_epochs` epochs. No leaf becomes narrower than `min_size` pixels,
  /// and the region of interest has at most `budget` leaves.
  TreeUpdates(int min_size, int budget, std::int64_t open_epochs, std::uint64_t seed);
  /// Never changes the tree.
  TreeUpdates() = default;

  /// Updates the tree after an epoch if an update is due. Returns whether the field and the state
  /// of the optimiser have changed.
  bool update(std::int64_t epochs_done, field::Field& field, Adam::State& optimizer,
              TreeProgress& progress) const;

 private:
  int min_size_ = 0, budget_ = 0;
  std::int64_t open_epochs_ = 0;
  std::uint64_t seed_ = 0;
};

/// Counts the leaves of the region of interest at each level; level 0 has the root cells.
std::vector<std::int64_t> leaves_by_level(const field::Quadtree& tree);

}  // namespace tomofield::fit
