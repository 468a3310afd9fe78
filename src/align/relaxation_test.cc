#include "align/relaxation.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tomofield::alignment {
namespace {

TEST(Relaxation, StepsBecomeShorterOnceTheyTurnBack) {
  Relaxation relaxation;
  EXPECT_DOUBLE_EQ(relaxation.next({1.0, -2.0}), 1.3);
  EXPECT_DOUBLE_EQ(relaxation.next({0.4, -0.7}), 1.3);
  EXPECT_DOUBLE_EQ(relaxation.next({-0.2, 0.3}), 1.3) << "it turns too little to tell";
  EXPECT_DOUBLE_EQ(relaxation.next({0.2, -0.2}), 0.78);
  EXPECT_DOUBLE_EQ(relaxation.next({0.2, -0.1}), 0.78);
  for (int step = 0; step < 20; ++step) relaxation.next({step % 2 == 0 ? -1.0 : 1.0, 0.0});
  EXPECT_DOUBLE_EQ(relaxation.next({-1.0, 0.0}), 0.4);
}

// Returns the error that is left after some updates if registrations show `shown` of it.
double error_left(double shown) {
  Relaxation relaxation;
  double error = 1.0;
  for (int update = 0; update < 30; ++update) {
    const double found = -shown * error;
    error += relaxation.next({found, 0.5 * found}) * found;
  }
  return std::abs(error);
}

TEST(Relaxation, UpdatesConvergeEvenIfRegistrationsShowFarTooMuch) {
  for (const double shown : {0.2, 0.7, 1.0, 1.6, 2.5, 4.0})
    EXPECT_LT(error_left(shown), 0.01) << shown;
}

}  // namespace
}  // namespace tomofield::alignment
