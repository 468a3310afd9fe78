#include "align/relaxation.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace tomofield::alignment {
namespace {

constexpr double kTurned = 0.7;    // of the last step, from which on steps become shorter
constexpr double kShorter = 0.6;   // is multiplied to the factor then
constexpr double kSmallest = 0.4;  // factor

double product(std::span<const double> a, std::span<const double> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

}  // namespace

bool turns_back(std::span<const double> step, std::span<const double> last, double part) {
  return product(step, last) < -part * product(last, last);
}

double Relaxation::next(std::vector<double> found) {
  if (!last_.empty() && turns_back(found, last_, kTurned))
    factor_ = std::max(kSmallest, kShorter * factor_);
  last_ = std::move(found);
  return factor_;
}

}  // namespace tomofield::alignment
