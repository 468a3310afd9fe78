#include "align/unalike.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"

namespace tomofield::alignment {
namespace {

struct Correlations {
  std::vector<double> tilt_deg, values;
};

// Returns correlations that fall with the tilt, with some noise, in the order of a dose-symmetric
// scheme.
Correlations falling(double highest, double noise) {
  Correlations series;
  base::Random random(4);
  for (int i = 0; i < 41; ++i) {
    const double tilt = (i % 2 == 0 ? 1.5 : -1.5) * i;
    series.tilt_deg.push_back(tilt);
    series.values.push_back(highest * std::cos(tilt / 60.0) + noise * random.normal());
  }
  return series;
}

TEST(Unalike, ViewsOfTheSpecimenAreAlike) {
  for (const double highest : {0.1, 0.4, 0.97}) {
    const Correlations series = falling(highest, 0.02);
    EXPECT_EQ(unalike(series.tilt_deg, series.values), std::vector<int>{}) << highest;
  }
}

TEST(Unalike, NamesAViewAtAWrongPlace) {
  Correlations series = falling(0.97, 0.004);
  series.values[7] = 0.6;    // at a wrong place
  series.values[30] = -0.1;  // noise
  series.values[40] = 0.1;
  EXPECT_EQ(unalike(series.tilt_deg, series.values), (std::vector<int>{7, 30, 40}));
}

TEST(Unalike, NoisyViewsDifferByAccident) {
  Correlations series = falling(0.4, 0.06);
  series.values[7] = 0.25;
  series.values[30] = 0.01;
  EXPECT_EQ(unalike(series.tilt_deg, series.values), std::vector<int>{30});
}

TEST(Unalike, FewViewsTellNothing) {
  EXPECT_EQ(unalike(std::vector<double>{}, std::vector<double>{}), std::vector<int>{});
  EXPECT_EQ(unalike(std::vector{0.0}, std::vector{0.5}), std::vector<int>{});
}

}  // namespace
}  // namespace tomofield::alignment
