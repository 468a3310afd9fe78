#pragma once

namespace tomofield::compact {

/// Looks for the price at which a sum meets its limit. An error grows with the price, and a cost
/// falls, about as a power of it does, which the last two prices tell.
class PriceSearch {
 public:
  /// Begins at the price `first`, which is above 0. The sum grows with the price, or falls.
  PriceSearch(double first, bool grows);

  double price() const { return price_; }

  /// Chooses the next price after one whose sum is `ratio` times its limit; `ratio` is above 0. The
  /// next price lies between all those that were too low and all those that were too high, so these
  /// bounds never cross, even if the sum at a price changes from round to round.
  void go_on(double ratio);

 private:
  void learn_power(double ratio);

  double price_;
  bool grows_;
  double power_;                                // of the price that the sum follows
  double last_price_ = 0.0, last_ratio_ = 0.0;  // of the round before, or 0
  double low_ = 0.0, high_ = 0.0;               // prices below and above the wanted one, or 0
};

}  // namespace tomofield::compact
