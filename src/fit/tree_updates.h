#pragma once

#include <cstdint>
#include <vector>

#include "field/field.h"
#include "fit/adam.h"

namespace tomofield::fit {

/// One update of an adaptive tree, for the result's JSON.
struct TreeUpdate {
  std::int64_t epoch = 0;  ///< epochs done
  std::int64_t splits = 0, merges = 0;
  double error = 0.0;                         ///< Σ of the leaves' errors before it
  double predicted_error = 0.0;               ///< and as predicted after it
  std::vector<std::int64_t> leaves_by_level;  ///< after it, of the region of interest
};

/// Where the structure of a field stands; part of a fit's progress.
struct TreeProgress {
  bool is_frozen = false;
  std::vector<TreeUpdate> updates;
};

/// When and how an adaptive tree changes (DESIGN §4): every other epoch while the
/// structure is open, until a plan changes nothing.
class TreeUpdates {
 public:
  /// The structure is open for `open_epochs`; leaves stay at least `min_size` wide and
  /// at most `budget` in number.
  TreeUpdates(int min_size, int budget, std::int64_t open_epochs, std::uint64_t seed);
  /// Of a tree that stays as it is.
  TreeUpdates() = default;

  /// After an epoch: true if the field and the optimiser's state have changed.
  bool update(std::int64_t epochs_done, field::Field& field, Adam::State& optimizer,
              TreeProgress& progress) const;

 private:
  int min_size_ = 0, budget_ = 0;
  std::int64_t open_epochs_ = 0;
  std::uint64_t seed_ = 0;
};

/// Leaves of the region of interest at each level, root cells first.
std::vector<std::int64_t> leaves_by_level(const field::Quadtree& tree);

}  // namespace tomofield::fit
