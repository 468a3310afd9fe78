#include "compact/candidate_search.h"

#include <algorithm>
#include <limits>

#include "base/threads/parallel.h"
#include "compact/truncation.h"

namespace tomofield::compact {

CandidateSearch::CandidateSearch(const VertexDensities& vertices, const PlaceSquares& squares)
    : vertices_(vertices),
      squares_(squares),
      places_(squares.nodes.size()),
      prices_(places_.size()),
      is_tried_(places_.size(), 1) {
  for (std::size_t i = 0; i < places_.size(); ++i) {
    places_[i].first_child = squares_.nodes[i].first_child;
    if (squares_.leaf_like[i] == PlaceSquares::kOutside) {
      places_[i].candidates.push_back({});
      prices_[i].push_back(std::numeric_limits<double>::infinity());
    }
  }
}

void CandidateSearch::keep_near(const Choice& choice, double price) {
  is_tried_.assign(places_.size(), 0);
  for (std::size_t i = 0; i < places_.size(); ++i) {
    if (choice.candidate[i] < 0) continue;
    is_tried_[i] = 1;
    const field::QuadtreeNode& node = squares_.nodes[i];
    if (node.parent >= 0 && is_nearly_as_good(node.parent, price))
      is_tried_[static_cast<std::size_t>(node.parent)] = 1;
    for (int child = 0; child < 4 && node.first_child >= 0; ++child)
      is_tried_[static_cast<std::size_t>(node.first_child + child)] = 1;
  }
}

// Returns whether a place costs little more than its quarters do.
bool CandidateSearch::is_nearly_as_good(int place, double price) const {
  constexpr double kLittle = 1.1;
  const auto least = [&](int i) {
    double value = std::numeric_limits<double>::infinity();
    for (const Candidate& candidate : places_[static_cast<std::size_t>(i)].candidates)
      value = std::min(value, candidate.error + price * candidate.cost);
    return value;
  };
  const int first = places_[static_cast<std::size_t>(place)].first_child;
  const double of_quarters = least(first) + least(first + 1) + least(first + 2) + least(first + 3);
  return least(place) <= kLittle * of_quarters;
}

void CandidateSearch::add(double price) {
  const int deepest = squares_.nodes.back().level;
  for (int level = deepest; level >= 0; --level) {
    const std::vector<int> below =
        level < deepest ? cheapest_choice(places_, price).candidate : std::vector<int>{};
    const auto is_worthwhile = [&](std::size_t place) {
      const int first = places_[place].first_child;
      if (first < 0 || places_[static_cast<std::size_t>(first)].first_child < 0) return true;
      return std::any_of(below.begin() + first, below.begin() + first + 4,
                         [](int chosen) { return chosen != kSplit; });
    };
    std::vector<std::size_t> tried;
    for (std::size_t i = 0; i < places_.size(); ++i) {
      if (squares_.nodes[i].level == level && squares_.leaf_like[i] >= 0 && is_tried_[i] &&
          is_worthwhile(i))
        tried.push_back(i);
    }
    add_to(tried, price);
  }
}

void CandidateSearch::add_to(const std::vector<std::size_t>& tried, double price) {
  base::parallel_for("truncate places", std::ssize(tried), [&](std::int64_t i) {
    const std::size_t at = tried[static_cast<std::size_t>(i)];
    const PlaceDensities place = vertices_.read(squares_.nodes[at].square);
    const Truncation modes = truncate(place, price / place.volume_of_vertex);
    places_[at].candidates.push_back({.cost = static_cast<double>(modes.num_parameters()),
                                      .error = modes.square_error * place.volume_of_vertex});
    prices_[at].push_back(price);
  });
}

}  // namespace tomofield::compact
