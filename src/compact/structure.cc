#include "compact/structure.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tomofield::compact {
namespace {

// Adds up what is chosen, and marks the places below leaves as unused.
void finish(const PlaceTree& places, Choice& choice) {
  std::vector<char> is_child(places.size(), 0);
  for (const Place& place : places) {
    for (int child = 0; child < 4 && place.first_child >= 0; ++child)
      is_child[static_cast<std::size_t>(place.first_child + child)] = 1;
  }
  std::vector<char> is_reached(places.size(), 0);
  choice.cost = choice.error = 0.0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (!is_child[i]) is_reached[i] = 1;
    int& chosen = choice.candidate[i];
    if (!is_reached[i]) {
      chosen = kUnused;
    } else if (chosen == kSplit) {
      for (int child = 0; child < 4; ++child)
        is_reached[static_cast<std::size_t>(places[i].first_child + child)] = 1;
    } else {
      const Candidate& candidate = places[i].candidates[static_cast<std::size_t>(chosen)];
      choice.cost += candidate.cost;
      choice.error += candidate.error;
    }
  }
}

// Finds by bisection of the logarithm the multiplier at which `is_enough` becomes true; it is true
// for large ones (or for small ones, if `large_is_enough` is false). Returns the choice on the true
// side.
template <typename IsEnough>
Choice bisect(const PlaceTree& places, bool large_is_enough, const IsEnough& is_enough) {
  constexpr double kSmallest = 1e-30, kLargest = 1e30;
  constexpr int kHalvings = 100;
  double enough = large_is_enough ? kLargest : kSmallest;
  double not_enough = large_is_enough ? kSmallest : kLargest;
  Choice best = cheapest_choice(places, enough);
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = std::sqrt(enough) * std::sqrt(not_enough);
    Choice choice = cheapest_choice(places, middle);
    if (is_enough(choice)) {
      enough = middle;
      best = std::move(choice);
    } else {
      not_enough = middle;
    }
  }
  return best;
}

}  // namespace

Choice cheapest_choice(const PlaceTree& places, double multiplier) {
  Choice choice{.candidate = std::vector<int>(places.size(), kSplit)};
  std::vector<double> least(places.size());
  for (std::size_t i = places.size(); i-- > 0;) {
    const Place& place = places[i];
    double& value = least[i];
    value = std::numeric_limits<double>::infinity();
    if (place.first_child >= 0) {
      value = 0;
      for (int child = 0; child < 4; ++child)
        value += least[static_cast<std::size_t>(place.first_child + child)];
    }
    for (std::size_t c = 0; c < place.candidates.size(); ++c) {
      const double sum = place.candidates[c].error + multiplier * place.candidates[c].cost;
      if (sum > value) continue;
      value = sum;
      choice.candidate[i] = static_cast<int>(c);
    }
  }
  finish(places, choice);
  return choice;
}

Choice choose_within_cost(const PlaceTree& places, double budget) {
  return bisect(places, true, [&](const Choice& choice) { return choice.cost <= budget; });
}

Choice choose_within_error(const PlaceTree& places, double most) {
  return bisect(places, false, [&](const Choice& choice) { return choice.error <= most; });
}

}  // namespace tomofield::compact
