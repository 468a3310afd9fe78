#include "compact/price_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace tomofield::compact {
namespace {

// Two rounds tell the power, and the third one has the price.
TEST(PriceSearch, FindsThePriceOfPowerLaws) {
  constexpr double kWanted = 3e-4;
  for (const double power : {0.5, 1.15, -0.6}) {
    for (const double first : {1e-6, 2e-4, 1e-1}) {
      PriceSearch search(first, power > 0);
      const auto ratio = [&] { return std::pow(search.price() / kWanted, power); };
      int rounds = 1;
      for (; std::abs(ratio() - 1) >= 0.005 && rounds < 10; ++rounds) search.go_on(ratio());
      EXPECT_LE(rounds, 4) << power << " from " << first;
      EXPECT_NEAR(search.price() / kWanted, 1, 0.01) << power << " from " << first;
    }
  }
}

// A cost that falls in steps has no price at which it is the limit: the search stays at the step.
TEST(PriceSearch, StaysBetweenItsBounds) {
  PriceSearch search(1.0, false);
  for (int round = 0; round < 30; ++round) search.go_on(search.price() < 5 ? 10 : 0.1);
  EXPECT_NEAR(search.price(), 5, 0.1);
}

TEST(PriceSearch, EqualPricesTellNoPower) {
  PriceSearch search(2.0, true);
  search.go_on(1);
  EXPECT_EQ(search.price(), 2);
  search.go_on(1);
  EXPECT_EQ(search.price(), 2);
  search.go_on(0.5);
  EXPECT_NEAR(search.price(), 2 * std::pow(0.5, -1 / 0.8), 1e-12) << "the first power is kept";
}

// Candidates are added between rounds, so the sum at a price may change. Whatever it does, a price
// lies between those before that were too low and those that were too high.
TEST(PriceSearch, BoundsNeverCross) {
  base::Random random(1);
  for (const bool grows : {true, false}) {
    for (int run = 0; run < 50; ++run) {
      PriceSearch search(1.0, grows);
      double too_low = 0, too_high = INFINITY;
      for (int round = 0; round < 12; ++round) {
        const double price = search.price();
        ASSERT_GT(price, too_low);
        ASSERT_LT(price, too_high);
        const double ratio = std::exp(random.uniform(-3, 3));
        (grows == (ratio > 1) ? too_high : too_low) = price;
        search.go_on(ratio);
      }
    }
  }
}

}  // namespace
}  // namespace tomofield::compact
