#include "compact/leaf_code.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "compact/quantise.h"
#include "field/field.h"
#include "random_arrays.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::compact {
namespace {

using testing::message_of;

constexpr int kX = 7, kY = 6, kZ = 5;

PlaceDensities random_place() {
  const std::vector<float> values = testing::random_floats(kX * kY * kZ, 4);
  return {.nx = kX,
          .ny = kY,
          .nz = kZ,
          .values = Eigen::Map<const FloatMatrix>(values.data(), kX, kZ * kY),
          .volume_of_vertex = 1.0};
}

QuantisedLeaf some_leaf(double step) {
  return quantise(truncate(random_place(), 0.005), kX, kY, kZ, step);
}

TEST(LeafCode, ComesBack) {
  const QuantisedLeaf leaf = some_leaf(0.01);
  ASSERT_GT(leaf.numbers.size(), 50u);
  const std::vector<std::uint8_t> code = encode(leaf);
  EXPECT_EQ(decode(code, leaf.shape).numbers, leaf.numbers);
}

TEST(LeafCode, HoldsAnyNumbers) {
  QuantisedLeaf leaf{.shape = {.nx = 2, .ny = 2, .nz = 2, .rank_z = 1},
                     .numbers = {0, -1, 63, -64, 64, std::numeric_limits<std::int32_t>::max()}};
  leaf.numbers[1] = std::numeric_limits<std::int32_t>::min();
  EXPECT_EQ(decode(encode(leaf), leaf.shape).numbers, leaf.numbers);
}

TEST(LeafCode, ALeafWithoutComponentsTakesNoBytes) {
  const QuantisedLeaf leaf{.shape = {.nx = 9, .ny = 9, .nz = 9}, .numbers = {}};
  EXPECT_TRUE(encode(leaf).empty());
  EXPECT_TRUE(decode({}, leaf.shape).numbers.empty());
}

// Rounding is uniform in ±½ step, so the expected square is 1/12 a parameter.
TEST(LeafCode, RoundingMakesTheExpectedError) {
  const PlaceDensities place = random_place();
  const Truncation modes = truncate(place, 0.005);
  const FloatMatrix exact = values_of(modes, kX, kY, kZ);
  for (const double step : {0.1, 0.03, 0.01}) {
    const QuantisedLeaf leaf = quantise(modes, kX, kY, kZ, step);
    const double square = static_cast<double>(
        (values_of(dequantised_modes(leaf, step), kX, kY, kZ) - exact).squaredNorm());
    const double expected = step * step / 12 * static_cast<double>(leaf.numbers.size());
    EXPECT_GT(square, 0.6 * expected) << step;
    EXPECT_LT(square, 1.5 * expected) << step;
  }
}

TEST(LeafCode, ParametersAreThoseOfAFieldOfFactors) {
  constexpr double kStep = 0.02, kThickness = 20.0;
  const QuantisedLeaf leaf = some_leaf(kStep);
  const field::RootGrid roots{.x0 = 0, .y0 = 0, .cell_size = 64, .columns = 1, .rows = 1};
  const auto field = field::make_field(
      FieldKind::kVm, field::Quadtree(roots, {field::Region::kInterest}), kThickness, {leaf.shape});
  dequantise(leaf, kStep, field->parameters());
  const FloatMatrix expected = values_of(dequantised_modes(leaf, kStep), kX, kY, kZ);
  std::vector<float> row(kX * kZ);
  for (int y = 0; y < kY; ++y) {
    field->row_values(0, field::kPixelCentre + 64.0 * y / (kY - 1), row.data());
    for (int x = 0; x < kX; ++x)
      for (int z = 0; z < kZ; ++z)
        EXPECT_NEAR(row[static_cast<std::size_t>(x * kZ + z)], expected(x, z * kY + y), 1e-5);
  }
}

TEST(LeafCode, DamageIsFound) {
  const QuantisedLeaf leaf = some_leaf(0.01);
  const std::vector<std::uint8_t> code = encode(leaf);
  base::Random random(5);
  for (std::size_t at = 0; at < code.size(); ++at) {
    std::vector<std::uint8_t> changed = code;
    changed[at] = static_cast<std::uint8_t>(changed[at] ^ (1 << random.below(8)));
    // The header has bits without a meaning; everything else is under the checksum.
    try {
      EXPECT_EQ(decode(changed, leaf.shape).numbers, leaf.numbers) << "byte " << at;
    } catch (const Error&) {
    }
  }
  const std::vector<std::uint8_t> torn(code.begin(), code.end() - 7);
  EXPECT_NE(message_of<Error>([&] { decode(torn, leaf.shape); }).find("damaged"),
            std::string::npos);
  field::LeafShape other = leaf.shape;
  ++other.rank_x;
  EXPECT_NE(message_of<Error>([&] { decode(code, other); }).find("ends early"), std::string::npos);
  field::LeafShape immense = leaf.shape;
  immense.nx = immense.nz = field::LeafShape::kMaxVertices;
  immense.rank_y = 100;
  EXPECT_NE(message_of<Error>([&] { decode(code, immense); }).find("too short"), std::string::npos);
  other.rank_x -= 2;
  EXPECT_NE(message_of<Error>([&] { decode(code, other); }), "");
}

}  // namespace
}  // namespace tomofield::compact
