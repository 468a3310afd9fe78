#include "align/local/slow_modes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "align/relaxation.h"

namespace tomofield::alignment {
namespace {

constexpr double kAmplification = 2.0;  // is added to the factor of the slowest mode
constexpr double kModes = 3.0;          // the addition falls with exp(−(mode / kModes)²)
constexpr int kMostModes = 12;          // later ones have no addition
constexpr double kTurnsBack = 0.3;      // of the last step, from which on a step turns back

}  // namespace

void amplify_slow_modes(std::span<double> values) {
  const auto n = static_cast<int>(values.size());
  std::vector<double> added(values.size());
  for (int mode = 0; mode < std::min(n, kMostModes); ++mode) {
    const auto cosine = [&](int i) {
      return std::sqrt((mode == 0 ? 1.0 : 2.0) / n) *
             std::cos(std::numbers::pi * (i + 0.5) * mode / n);
    };
    double part = 0.0;
    for (int i = 0; i < n; ++i) part += values[static_cast<std::size_t>(i)] * cosine(i);
    part *= kAmplification * std::exp(-std::pow(mode / kModes, 2));
    for (int i = 0; i < n; ++i) added[static_cast<std::size_t>(i)] += part * cosine(i);
  }
  for (std::size_t i = 0; i < values.size(); ++i) values[i] += added[i];
}

void SlowModeAmplifier::amplify(std::span<double> steps) {
  std::vector<double> added(steps.begin(), steps.end());
  amplify_slow_modes(added);
  for (std::size_t i = 0; i < added.size(); ++i) added[i] -= steps[i];
  if (last_added_.empty()) last_added_.resize(added.size());
  if (turns_back(added, last_added_, kTurnsBack)) part_ /= 2;
  for (std::size_t i = 0; i < added.size(); ++i) steps[i] += part_ * added[i];
  last_added_ = std::move(added);
}

}  // namespace tomofield::alignment
