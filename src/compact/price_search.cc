#include "compact/price_search.h"

#include <algorithm>
#include <cmath>

namespace tomofield::compact {
namespace {

constexpr double kPowerOfError = 0.8, kPowerOfCost = -0.6;  // before two rounds tell it
constexpr double kLeastPower = 0.2, kMostPower = 3.0;

}  // namespace

PriceSearch::PriceSearch(double first, bool grows)
    : price_(first), grows_(grows), power_(grows ? kPowerOfError : kPowerOfCost) {}

void PriceSearch::go_on(double ratio) {
  learn_power(ratio);
  last_price_ = price_;
  last_ratio_ = ratio;
  (grows_ == (ratio > 1) ? high_ : low_) = price_;
  price_ *= std::pow(ratio, -1 / power_);
  const bool is_bounded = low_ > 0 && high_ > 0;
  if (is_bounded && (price_ <= low_ || price_ >= high_)) price_ = std::sqrt(low_ * high_);
}

// Finds the power from this round and the one before. The same price twice tells nothing.
void PriceSearch::learn_power(double ratio) {
  if (last_price_ <= 0 || last_price_ == price_) return;
  const double found = std::log(ratio / last_ratio_) / std::log(price_ / last_price_);
  power_ = grows_ ? std::clamp(found, kLeastPower, kMostPower)
                  : std::clamp(found, -kMostPower, -kLeastPower);
}

}  // namespace tomofield::compact
