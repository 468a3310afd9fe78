#include "compact/structure.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "fit/integer_program.h"

namespace tomofield::compact {
namespace {

// Returns two roots; every place of the first levels has four children. Errors fall with the cost,
// as singular values do, and differ from place to place.
PlaceTree random_places(int levels, std::uint64_t seed) {
  base::Random random(seed);
  PlaceTree places(2);
  std::size_t end_of_level = 0;
  for (int level = 0; level < levels; ++level) {
    const std::size_t first = end_of_level;
    end_of_level = places.size();
    for (std::size_t i = first; i < end_of_level; ++i) {
      const double detail = std::exp(random.uniform(-2, 2)) / std::pow(4, level);
      const double side = std::pow(2, levels - level);
      for (const double rank : {0.0, 1.0, 2.0, 4.0, 8.0})
        places[i].candidates.push_back(
            {.cost = rank * (10 + side * side), .error = detail / (1 + rank)});
      if (level + 1 == levels) continue;
      places[i].first_child = static_cast<int>(places.size());
      places.resize(places.size() + 4);
    }
  }
  return places;
}

// Adds up a choice and checks that its leaves cover every place without children once.
void expect_valid(const PlaceTree& places, const Choice& choice) {
  double cost = 0, error = 0;
  std::vector<int> covered(places.size(), 0);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const int chosen = choice.candidate[i];
    const bool is_leaf = chosen >= 0;
    if (is_leaf) {
      cost += places[i].candidates[static_cast<std::size_t>(chosen)].cost;
      error += places[i].candidates[static_cast<std::size_t>(chosen)].error;
    }
    covered[i] += is_leaf;
    for (int child = 0; child < 4 && places[i].first_child >= 0; ++child)
      covered[static_cast<std::size_t>(places[i].first_child + child)] += covered[i];
    if (places[i].first_child < 0) {
      EXPECT_EQ(covered[i], 1) << "place " << i;
    }
  }
  EXPECT_NEAR(choice.cost, cost, 1e-9);
  EXPECT_NEAR(choice.error, error, 1e-9);
}

// Solves the problem exactly. A variable says that a candidate is chosen. On the path from a root
// to a place without children, exactly one candidate is chosen: two rows for "at most" and "at
// least".
Choice choose_exactly(const PlaceTree& places, double budget) {
  fit::IntegerProgram program;
  std::vector<int> first_variable, parent(places.size(), -1);
  fit::IntegerProgram::Row within{.terms = {}, .bound = budget};
  for (std::size_t i = 0; i < places.size(); ++i) {
    first_variable.push_back(static_cast<int>(program.costs.size()));
    for (const Candidate& candidate : places[i].candidates) {
      within.terms.push_back({static_cast<int>(program.costs.size()), candidate.cost});
      program.costs.push_back(candidate.error);
    }
    for (int child = 0; child < 4 && places[i].first_child >= 0; ++child)
      parent[static_cast<std::size_t>(places[i].first_child + child)] = static_cast<int>(i);
  }
  program.rows.push_back(std::move(within));
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (places[i].first_child >= 0) continue;
    fit::IntegerProgram::Row most{.terms = {}, .bound = 1}, least{.terms = {}, .bound = -1};
    for (int place = static_cast<int>(i); place >= 0; place = parent[place]) {
      const auto at = static_cast<std::size_t>(place);
      for (int c = 0; c < std::ssize(places[at].candidates); ++c) {
        most.terms.push_back({first_variable[at] + c, 1});
        least.terms.push_back({first_variable[at] + c, -1});
      }
    }
    program.rows.push_back(std::move(most));
    program.rows.push_back(std::move(least));
  }
  const std::vector<bool> solution = fit::solve(program);
  Choice choice{.candidate = std::vector<int>(places.size(), kSplit)};
  for (std::size_t i = 0; i < places.size(); ++i) {
    for (int c = 0; c < std::ssize(places[i].candidates); ++c)
      if (solution[static_cast<std::size_t>(first_variable[i] + c)]) {
        choice.candidate[i] = c;
        choice.cost += places[i].candidates[static_cast<std::size_t>(c)].cost;
        choice.error += places[i].candidates[static_cast<std::size_t>(c)].error;
      }
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    for (int child = 0; child < 4 && places[i].first_child >= 0; ++child)
      if (choice.candidate[i] != kSplit)
        choice.candidate[static_cast<std::size_t>(places[i].first_child + child)] = kUnused;
  }
  return choice;
}

TEST(Structure, BudgetsAreKept) {
  const PlaceTree places = random_places(4, 1);
  double last_error = INFINITY;
  for (const double budget : {0.0, 50.0, 500.0, 5000.0, 1e9}) {
    const Choice choice = choose_within_cost(places, budget);
    expect_valid(places, choice);
    EXPECT_LE(choice.cost, budget);
    EXPECT_LE(choice.error, last_error);
    last_error = choice.error;
  }
  for (const double error : {0.5, 2.0, 1e9}) {
    const Choice choice = choose_within_error(places, error);
    expect_valid(places, choice);
    EXPECT_LE(choice.error, error);
  }
  EXPECT_EQ(choose_within_error(places, 1e9).cost, 0.0);
}

TEST(Structure, RelaxationIsExactAtItsOwnCost) {
  if (!fit::can_solve_integer_programs()) GTEST_SKIP() << "this build has no CBC";
  int num_different = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const PlaceTree places = random_places(3, seed);
    for (const double budget : {60.0, 200.0, 700.0}) {
      const Choice relaxed = choose_within_cost(places, budget);
      const Choice exact = choose_exactly(places, relaxed.cost);
      expect_valid(places, exact);
      EXPECT_LE(exact.cost, relaxed.cost + 1e-6);
      EXPECT_NEAR(relaxed.error, exact.error, 1e-6);
      // Between two points of the convex hull, the program may find more.
      const Choice more = choose_exactly(places, budget);
      EXPECT_LE(more.error, relaxed.error + 1e-6);
      num_different += more.error < relaxed.error - 1e-6;
    }
  }
  EXPECT_GT(num_different, 0);
}

}  // namespace
}  // namespace tomofield::compact
