#include "align/slow_modes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace tomofield::align {
namespace {

constexpr double kAmplification = 2.0;  // is added to the factor of the slowest mode
constexpr double kModes = 3.0;          // the addition falls with exp(−(mode / kModes)²)
constexpr int kMostModes = 12;          // later ones have no addition

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

}  // namespace tomofield::align
