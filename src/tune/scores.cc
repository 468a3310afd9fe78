#include "tune/scores.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

#include "base/statistics.h"

namespace tomofield::tune {
namespace {

// The maximum number of coarse steps to one side: a factor of 256.
constexpr int kMaxSteps = 4;

// The standard deviation of a normal distribution, in units of its median absolute deviation.

using Errors = std::pair<const std::vector<double>&, const std::vector<double>&>;

// Returns the errors that two trials both have, of patches or else of views.
Errors common_errors(const HeldOutScore& a, const HeldOutScore& b) {
  const bool by_patch = !a.patch_error.empty() && a.patch_error.size() == b.patch_error.size();
  if (by_patch) return {a.patch_error, b.patch_error};
  return {a.view_error, b.view_error};
}

Difference of_totals(const HeldOutScore& a, const HeldOutScore& b) {
  return {a.error > 0 && b.error > 0 ? std::log(a.error / b.error) : 0.0, 0.0};
}

}  // namespace

bool most_views_prefer(const HeldOutScore& a, const HeldOutScore& b) {
  const std::size_t n = std::min(a.view_error.size(), b.view_error.size());
  std::size_t prefer_a = 0;
  for (std::size_t v = 0; v < n; ++v) prefer_a += a.view_error[v] < b.view_error[v] ? 1 : 0;
  return 2 * prefer_a > n;
}

Difference difference(const HeldOutScore& a, const HeldOutScore& b) {
  const auto [of_a, of_b] = common_errors(a, b);
  std::vector<double> ratios;
  for (std::size_t i = 0; i < std::min(of_a.size(), of_b.size()); ++i)
    if (of_a[i] > 0 && of_b[i] > 0) ratios.push_back(std::log(of_a[i] / of_b[i]));
  if (ratios.empty()) return of_totals(a, b);
  std::vector<double> means;
  for (std::size_t i = 0; i < ratios.size(); ++i)
    for (std::size_t j = i; j < ratios.size(); ++j) means.push_back((ratios[i] + ratios[j]) / 2);
  const double centre = base::median(ratios);
  const double location = base::median(std::move(means));
  for (double& ratio : ratios) ratio = std::abs(ratio - centre);
  const double count = static_cast<double>(ratios.size());
  return {location,
          base::kSigmaOfMedianDeviation * base::median(std::move(ratios)) / std::sqrt(count)};
}

Difference difference_of_means(const HeldOutScore& a, const HeldOutScore& b) {
  const auto [of_a, of_b] = common_errors(a, b);
  const std::size_t n = std::min(of_a.size(), of_b.size());
  double sum_a = 0, sum_b = 0;
  for (std::size_t i = 0; i < n; ++i) {
    sum_a += of_a[i];
    sum_b += of_b[i];
  }
  if (sum_a <= 0 || sum_b <= 0) return of_totals(a, b);
  const double ratio = sum_a / sum_b;
  double squares = 0;
  for (std::size_t i = 0; i < n; ++i) squares += std::pow(of_a[i] - ratio * of_b[i], 2);
  return {std::log(ratio), std::sqrt(squares) / sum_a};
}

std::vector<std::size_t> as_good_as_the_best(const std::vector<HeldOutScore>& scores,
                                             double num_errors) {
  const HeldOutScore& best = *std::ranges::min_element(
      scores, {}, [&](const HeldOutScore& s) { return difference(s, scores.front()).log_ratio; });
  std::vector<std::size_t> as_good;
  for (std::size_t i = 0; i < scores.size(); ++i)
    if (!difference(scores[i], best).is_beyond(num_errors)) as_good.push_back(i);
  return as_good;
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
  return weights[as_good_as_the_best(scores).front()];
}

}  // namespace tomofield::tune
