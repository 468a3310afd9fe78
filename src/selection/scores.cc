#include "selection/scores.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>

namespace tomofield::selection {
namespace {

// The maximum number of coarse steps to one side: a factor of 256.
constexpr int kMaxSteps = 4;

}  // namespace

bool most_views_prefer(const HeldOutScore& a, const HeldOutScore& b) {
  const std::size_t n = std::min(a.view_error.size(), b.view_error.size());
  std::size_t prefer_a = 0;
  for (std::size_t v = 0; v < n; ++v) prefer_a += a.view_error[v] < b.view_error[v] ? 1 : 0;
  return 2 * prefer_a > n;
}

double standard_error_of_difference(const HeldOutScore& a, const HeldOutScore& b) {
  const std::size_t n = std::min(a.view_error.size(), b.view_error.size());
  if (n < 2) return 0;
  double sum = 0, squares = 0;
  for (std::size_t v = 0; v < n; ++v) {
    const double difference = a.view_error[v] - b.view_error[v];
    sum += difference;
    squares += difference * difference;
  }
  const double count = static_cast<double>(n);
  const double variance = std::max(squares - sum * sum / count, 0.0) / (count - 1);
  return std::sqrt(variance / count);
}

std::size_t first_as_good_as_the_best(const std::vector<HeldOutScore>& scores) {
  const HeldOutScore& best = *std::ranges::min_element(scores, {}, &HeldOutScore::error);
  const auto first = std::ranges::find_if(scores, [&](const HeldOutScore& s) {
    return s.error - best.error <= standard_error_of_difference(s, best);
  });
  return static_cast<std::size_t>(first - scores.begin());
}

double search_weight(double first, const ScoreOfWeight& score, const ExpectWeights& expect) {
  double best = first;
  std::map<double, HeldOutScore, std::greater<>> tried;
  const auto error_of = [&](double factor) {
    return (tried[best * factor] = score(best * factor)).error;
  };
  const auto expect_factors = [&](const std::vector<double>& factors) {
    std::vector<double> weights;
    for (const double factor : factors) weights.push_back(best * factor);
    if (expect) expect(weights);
  };
  // Takes coarse steps until the best weight has a worse one on either side, and then finer ones.
  expect_factors({4.0, 1});
  for (const double factor : {4.0, 0.25}) {
    for (int step = 0; step < kMaxSteps && error_of(factor) < error_of(1); ++step) best *= factor;
  }
  for (const double factor : {2.0, std::sqrt(2.0)}) {
    expect_factors({1 / factor, 1, factor});
    const double below = error_of(1 / factor), here = error_of(1), above = error_of(factor);
    if (std::min(below, above) >= here) continue;
    best *= above < below ? factor : 1 / factor;
  }
  std::vector<double> weights;  // the largest first
  std::vector<HeldOutScore> scores;
  for (const auto& [weight, its_score] : tried) {
    weights.push_back(weight);
    scores.push_back(its_score);
  }
  return weights[first_as_good_as_the_best(scores)];
}

}  // namespace tomofield::selection
