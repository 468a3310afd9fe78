#pragma once

#include <vector>

#include "compact/place_tree.h"
#include "compact/structure.h"
#include "compact/vertex_densities.h"

namespace tomofield::compact {

/// Finds candidates for places by truncating their densities (truncation.h) at one price of a
/// parameter after another.
class CandidateSearch {
 public:
  /// The arguments must outlive the object. A place out of the region of interest has one
  /// candidate, which costs nothing.
  CandidateSearch(const VertexDensities& vertices, const PlaceSquares& squares);

  /// Adds a candidate at this price to each place that is tried, from the smallest places up. A
  /// place whose quarters are all split is left out: a larger one is hardly ever better then.
  void add(double price);
  /// Restricts further rounds to the places of a choice, their children, and those of their parents
  /// that are nearly as good.
  void keep_near(const Choice& choice, double price);

  /// Returns the places with all candidates that were found.
  const PlaceTree& places() const { return places_; }
  /// Returns the price at which a candidate of a place was found.
  double price_of(std::size_t place, int candidate) const {
    return prices_[place][static_cast<std::size_t>(candidate)];
  }

 private:
  void add_to(const std::vector<std::size_t>& tried, double price);
  bool is_nearly_as_good(int place, double price) const;

  const VertexDensities& vertices_;
  const PlaceSquares& squares_;
  PlaceTree places_;
  std::vector<std::vector<double>> prices_;  // of each candidate
  std::vector<char> is_tried_;               // whether the next round adds a candidate to a place
};

}  // namespace tomofield::compact
