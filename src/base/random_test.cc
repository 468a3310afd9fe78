#include "base/random.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace tomofield::base {
namespace {

TEST(Random, SequenceIsTheSameForEver) {
  // An independent implementation of splitmix64 and xoshiro256** computed these values. Changing
  // the generator would change the results of every seed.
  struct Case {
    std::array<std::uint64_t, 2> seed_and_stream;
    std::array<std::uint64_t, 3> first;
  };
  const std::vector<Case> cases = {
      {{0, 0}, {0xae06a0e58587ad31u, 0xb11e5a6861971fa1u, 0x1ff5c95558c1b3b6u}},
      {{1, 0}, {0x8687f4c2f436e2bdu, 0x1536145ff316e88du, 0x5a56a05663ee3d36u}},
      {{1, 1}, {0xd3883b9166e498a5u, 0xbf0a1cacbe2ae256u, 0x9619e00df2dd8609u}},
      {{7, 1000}, {0xc7480ec4d4e4bc61u, 0xb5ef1a0bf21da103u, 0x0dcafe9da14fe35cu}}};
  for (const Case& c : cases) {
    Random random(c.seed_and_stream[0], c.seed_and_stream[1]);
    for (const std::uint64_t expected : c.first) EXPECT_EQ(random.bits(), expected);
  }
}

TEST(Random, SkippedNumbersAreThoseThatWereNotTaken) {
  for (const std::uint64_t count : {0u, 1u, 2u, 63u, 255u, 256u, 257u, 1000u, 123457u}) {
    Random taken(3, 9), skipped(3, 9);
    for (std::uint64_t i = 0; i < count; ++i) taken.bits();
    skipped.skip(count);
    for (int i = 0; i < 5; ++i) ASSERT_EQ(skipped.bits(), taken.bits()) << count;
  }
  Random twice(4), once(4);
  twice.skip(std::uint64_t{1} << 62);
  twice.skip(std::uint64_t{1} << 62);
  once.skip(std::uint64_t{1} << 63);
  EXPECT_EQ(twice.bits(), once.bits());
}

TEST(Random, NumbersAreUniform) {
  constexpr int kBins = 64, kCount = 64000;
  Random random(5, 2);
  std::array<int, kBins> bins{};
  double sum = 0, squares = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = random.uniform();
    ASSERT_GE(x, 0.0);
    ASSERT_LT(x, 1.0);
    ++bins[static_cast<std::size_t>(x * kBins)];
    sum += x;
    squares += x * x;
  }
  // The tolerances are five standard deviations of each estimate; χ² has 63 ± 11.2.
  EXPECT_NEAR(sum / kCount, 0.5, 5 * std::sqrt(1.0 / 12 / kCount));
  EXPECT_NEAR(squares / kCount, 1.0 / 3, 5 * std::sqrt(4.0 / 45 / kCount));
  double chi2 = 0;
  for (const int n : bins)
    chi2 += (n - kCount / kBins) * (n - kCount / kBins) / (1.0 * kCount / kBins);
  EXPECT_NEAR(chi2, 63, 5 * 11.2);
}

TEST(Random, BelowReachesEveryValueAlike) {
  Random random(9);
  std::array<int, 7> seen{};
  for (int i = 0; i < 7000; ++i) ++seen.at(random.below(7));
  for (const int n : seen) EXPECT_NEAR(n, 1000, 5 * 30);
  EXPECT_EQ(random.below(1), 0u);
}

TEST(Random, UniformOfARangeStaysInIt) {
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const double x = random.uniform(-2.5, 4.0);
    ASSERT_GE(x, -2.5);
    ASSERT_LT(x, 4.0);
  }
}

TEST(Random, NormalHasItsMoments) {
  constexpr int kCount = 60000;
  Random random(11);
  double mean = 0, variance = 0, fourth = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = random.normal();
    mean += x / kCount;
    variance += x * x / kCount;
    fourth += x * x * x * x / kCount;
  }
  EXPECT_NEAR(mean, 0, 5 / std::sqrt(kCount));
  EXPECT_NEAR(variance, 1, 5 * std::sqrt(2.0 / kCount));
  EXPECT_NEAR(fourth, 3, 5 * std::sqrt(96.0 / kCount));
}

TEST(Random, StreamsAndSeedsAreIndependent) {
  // Bands and epochs use neighbouring streams and seeds like these.
  constexpr int kCount = 20000;
  const std::vector<std::array<std::uint64_t, 2>> generators = {{1, 0}, {1, 1}, {1, 2},
                                                                {2, 0}, {2, 1}, {0, 0}};
  std::vector<std::vector<double>> numbers;
  for (const auto& [seed, stream] : generators) {
    Random random(seed, stream);
    auto& n = numbers.emplace_back();
    for (int i = 0; i < kCount; ++i) n.push_back(random.uniform(-1, 1));
  }
  for (std::size_t a = 0; a < numbers.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      for (const int lag : {0, 1}) {
        double product = 0;
        for (int i = lag; i < kCount; ++i) {
          product += numbers[a][static_cast<std::size_t>(i)] *
                     numbers[b][static_cast<std::size_t>(i - lag)];
        }
        EXPECT_NEAR(product / kCount, 0.0, 5 / 3.0 / std::sqrt(kCount)) << a << " " << b;
      }
    }
  }
}

}  // namespace
}  // namespace tomofield::base
