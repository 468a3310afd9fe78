#include "verdict/likeness_order.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

namespace tomofield::verdict {
namespace {

using evaluate::Image;

constexpr std::int64_t kImageSide = 48;
constexpr int kImages = 16;

using Pattern = std::vector<double>;

Pattern random_pattern(std::mt19937& random) {
  std::normal_distribution<double> normal;
  Pattern pattern(kImageSide * kImageSide);
  for (double& value : pattern) value = normal(random);
  return pattern;
}

// Returns images in order of tilt: a pattern that all have, one that turns into another with the
// tilt, and noise.
std::vector<Image> images_of(double common, double turning, double noise) {
  std::mt19937 random(7);
  const Pattern of_all = random_pattern(random);
  const Pattern first = random_pattern(random), last = random_pattern(random);
  std::vector<Image> images;
  for (int view = 0; view < kImages; ++view) {
    Image image{kImageSide, kImageSide, {}};
    const double angle = 0.2 * view;
    const Pattern of_noise = random_pattern(random);
    for (std::size_t i = 0; i < of_all.size(); ++i)
      image.values.push_back(static_cast<float>(
          common * of_all[i] + turning * (std::cos(angle) * first[i] + std::sin(angle) * last[i]) +
          noise * of_noise[i]));
    images.push_back(std::move(image));
  }
  return images;
}

std::vector<Image> shuffled(const std::vector<Image>& images) {
  std::vector<Image> other;
  for (int view = 0; view < kImages; ++view)
    other.push_back(images[static_cast<std::size_t>((view * 7) % kImages)]);
  return other;
}

TEST(OrderByLikeness, IsHighForTheAnglesOfTheViewsAndLowForShuffledOnes) {
  const std::vector<Image> images = images_of(0, 1, 0.3);
  EXPECT_GT(order_by_likeness(images).value(), 0.9);
  EXPECT_LT(order_by_likeness(shuffled(images)).value(), 0.7);
}

TEST(OrderByLikeness, IsJudgedOfViewsThatAreAllAlikeSoThatNoPairStandsOut) {
  EXPECT_TRUE(order_by_likeness(shuffled(images_of(3, 0.3, 1))));
}

TEST(OrderByLikeness, IsNotJudgedOfNoiseOrOfFewViews) {
  EXPECT_FALSE(order_by_likeness(images_of(0, 0, 1)));
  std::vector<Image> few = images_of(0, 1, 0.3);
  few.resize(11);
  EXPECT_FALSE(order_by_likeness(few));
}

}  // namespace
}  // namespace tomofield::verdict
