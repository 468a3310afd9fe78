#pragma once

#include <cstddef>
#include <vector>

namespace tomofield::compact {

/// A way to represent a square: what it costs and the error that it leaves.
struct Candidate {
  double cost = 0.0;   ///< parameters, or whatever the budget limits
  double error = 0.0;  ///< squared error times volume
};

/// A square of the quadtree that may become a leaf. Either one of its candidates stands for it, or
/// its four quarters do.
struct Place {
  std::vector<Candidate> candidates;  ///< may be empty if there are children
  int first_child = -1;               ///< the first of four places in a row; −1 if it has none
};

/// A quadtree of places. Children come after their parent. The roots are the places that are no
/// child.
using PlaceTree = std::vector<Place>;

/// The decision for each place: the number of its candidate, or one of these.
inline constexpr int kSplit = -1;   ///< its quarters stand for it
inline constexpr int kUnused = -2;  ///< a larger place stands for it
struct Choice {
  std::vector<int> candidate;  ///< one for each place
  double cost = 0.0, error = 0.0;
};

/// Returns the choice that minimises error + multiplier · cost: the multiplier is the error that a
/// unit of cost must save. It goes up the tree once.
Choice cheapest_choice(const PlaceTree& places, double multiplier);

/// Returns the choice with the smallest error whose cost is at most `budget`, among those that are
/// the cheapest for some multiplier (Lagrangian relaxation: Everett 1963; on quadtrees, Shoham and
/// Gersho 1988). No other choice of at most its cost has a smaller error. If no choice is within
/// the budget, the one of the least cost is returned.
Choice choose_within_cost(const PlaceTree& places, double budget);
/// Returns the choice of the smallest cost whose error is at most `most`, in the same way. If there
/// is none, the one of the smallest error is returned.
Choice choose_within_error(const PlaceTree& places, double most);

}  // namespace tomofield::compact
