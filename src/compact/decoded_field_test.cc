#include "compact/decoded_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "compact/quantise.h"
#include "field/field.h"
#include "random_arrays.h"

namespace tomofield::compact {
namespace {

using field::LeafShape;
using field::Region;

constexpr double kThickness = 9.0, kStep = 1e-3;

void append(LeafCodes& codes, const LeafShape& shape, const FloatMatrix& values) {
  const PlaceDensities place{
      .nx = shape.nx, .ny = shape.ny, .nz = shape.nz, .values = values, .volume_of_vertex = 1};
  const QuantisedLeaf leaf = quantise(truncate(place, 0), shape.nx, shape.ny, shape.nz, kStep);
  const std::vector<std::uint8_t> code = encode(leaf);
  codes.shapes.push_back(leaf.shape);
  codes.bytes.insert(codes.bytes.end(), code.begin(), code.end());
  codes.offset.push_back(std::ssize(codes.bytes));
}

// Returns two rows of three squares of 16 px: nothing, vertices 2 px apart, and vertices 4 px
// apart. The densities are random, and the last square has fewer vertices along z.
struct Leaves {
  Leaves() {
    LeafCodes& codes = coded.codes;
    codes.step = {kStep, kStep};
    codes.face_weight = {0, 0};
    codes.offset = {0};
    for (int row = 0; row < 2; ++row) {
      codes.shapes.push_back(kNoLeaf);
      codes.offset.push_back(codes.offset.back());
      values.emplace_back();
      for (const LeafShape shape :
           {LeafShape{.nx = 8, .ny = 8, .nz = 9}, LeafShape{.nx = 4, .ny = 4, .nz = 5}}) {
        const auto random = testing::random_floats(
            static_cast<std::size_t>(shape.nx * shape.ny * shape.nz), values.size());
        values.push_back(Eigen::Map<const FloatMatrix>(random.data(), shape.nx,
                                                       Eigen::Index{shape.nz} * shape.ny));
        append(codes, shape, values.back());
      }
    }
    const field::RootGrid roots{.x0 = 0, .y0 = 0, .cell_size = 16, .columns = 3, .rows = 2};
    coded.tree = field::Quadtree(roots, std::vector<Region>(6, Region::kInterest));
    coded.thickness = kThickness;
    made = decode_field(coded);
  }

  double value(int leaf, int i, int j, int k) const {
    const LeafShape& s = coded.codes.shapes[static_cast<std::size_t>(leaf)];
    return static_cast<double>(
        values[static_cast<std::size_t>(leaf)](i, Eigen::Index{k} * s.ny + j));
  }
  // Returns the density where vertex 0 of a leaf has the coordinates of the leaf's corner.
  double density(double x, double y, double z) const {
    return made->density(x + field::kPixelCentre, y + field::kPixelCentre, z + field::kPixelCentre);
  }

  // Returns the field with a weight for the faces of each of its two bands.
  std::unique_ptr<field::Field> softened(double lower_weight, double upper_weight) const {
    CodedField soft = coded;
    soft.codes.face_weight = {lower_weight, upper_weight};
    return decode_field(soft);
  }

  CodedField coded;
  std::vector<FloatMatrix> values;  // of each leaf
  std::unique_ptr<field::Field> made;
};

constexpr Rectangle kRegion{.x0 = 0, .y0 = 0, .x1 = 48, .y1 = 32};
constexpr double kNear = 0.02;  // many roundings

TEST(DecodedField, HasTheDensitiesOfTheLeaves) {
  const Leaves leaves;
  for (const int row : {0, 1}) {
    for (const int i : {0, 3, 7})
      for (const int j : {0, 5, 7})
        EXPECT_NEAR(leaves.density(16 + 2 * i, 16 * row + 2 * j, 4),
                    leaves.value(1 + 3 * row, i, j, 4), kNear);
    EXPECT_NEAR(leaves.density(32 + 4, 16 * row + 8, 2), leaves.value(2 + 3 * row, 1, 2, 1), kNear);
  }
}

// Between its last vertex and its upper face a leaf needs the first vertices of the next ones.
TEST(DecodedField, UpperFacesAreThoseOfTheNextLeaves) {
  const Leaves leaves;
  const double below = leaves.value(1, 4, 7, 3), above = leaves.value(4, 4, 0, 3);
  EXPECT_NEAR(leaves.density(16 + 8, 15, 3), (below + above) / 2, kNear);
  // The next leaf along x has vertices twice as far apart, in the plane and along z.
  const double left = leaves.value(1, 7, 2, 4), right = leaves.value(2, 0, 1, 2);
  EXPECT_NEAR(leaves.density(31, 4, 4), (left + right) / 2, kNear);
  const double between = (leaves.value(2, 0, 1, 1) + leaves.value(2, 0, 1, 2) +
                          leaves.value(2, 0, 2, 1) + leaves.value(2, 0, 2, 2)) /
                         4;
  EXPECT_NEAR(leaves.density(31, 6, 3), (leaves.value(1, 7, 3, 3) + between) / 2, kNear);
}

TEST(DecodedField, TheCornerIsThatOfTheLeafAcross) {
  const Leaves leaves;
  const double sum = leaves.value(1, 7, 7, 0) + leaves.value(2, 0, 3, 0) +
                     leaves.value(4, 7, 0, 0) + leaves.value(5, 0, 0, 0);
  EXPECT_NEAR(leaves.density(31, 15, 0), sum / 4, kNear);
}

// At the end of the field there is no next leaf, and the density stays that of the last vertex.
TEST(DecodedField, StaysTheSameUpToItsEnd) {
  const Leaves leaves;
  EXPECT_NEAR(leaves.density(45, 0, 0), leaves.value(2, 3, 0, 0), kNear);
  EXPECT_NEAR(leaves.density(16, 31, 5), leaves.value(4, 0, 7, 5), kNear);
  EXPECT_EQ(leaves.density(3, 3, 3), 0.0) << "nothing is there";
}

// A weight w leaves the part 1 - 2 w of the differences across faces, and no other vertex moves.
TEST(DecodedField, FacesAreSoftened) {
  constexpr double kWeight = 0.2;
  const Leaves leaves;
  const auto soft = leaves.softened(kWeight, kWeight);
  const auto density = [&](double x, double y, double z) {
    return soft->density(x + field::kPixelCentre, y + field::kPixelCentre, z + field::kPixelCentre);
  };
  EXPECT_NEAR(density(24, 16, 3) - density(24, 14, 3),
              (1 - 2 * kWeight) * (leaves.density(24, 16, 3) - leaves.density(24, 14, 3)), 1e-5);
  EXPECT_NEAR(density(24, 16, 3) + density(24, 14, 3),
              leaves.density(24, 16, 3) + leaves.density(24, 14, 3), 1e-5);
  EXPECT_EQ(density(24, 12, 3), leaves.density(24, 12, 3));
  EXPECT_EQ(density(30, 8, 3), leaves.density(30, 8, 3)) << "the next leaf has another spacing";
  EXPECT_NEAR(matching_face_weight(*leaves.made, leaves.coded.codes, *soft, kRegion), kWeight,
              1e-4);
  EXPECT_EQ(matching_face_weight(*leaves.made, leaves.coded.codes, *leaves.made, kRegion), 0.0);
}

// A fit goes on beyond the region, where a compact field is empty.
TEST(DecodedField, VerticesOutsideTheRegionDoNotChangeTheWeight) {
  constexpr double kWeight = 0.2;
  const Leaves leaves;
  const auto original = leaves.softened(kWeight, kWeight);
  for (const int leaf : {2, 5}) {
    const std::size_t begin = original->offset(leaf);
    const std::size_t end = leaf == 5 ? original->parameters().size() : original->offset(leaf + 1);
    for (float& value : original->parameters().subspan(begin, end - begin)) value *= 3;
  }
  const auto weight = [&](const Rectangle& region) {
    return matching_face_weight(*leaves.made, leaves.coded.codes, *original, region);
  };
  EXPECT_NEAR(weight({.x0 = 0, .y0 = 0, .x1 = 32, .y1 = 32}), kWeight, 1e-4);
  EXPECT_GT(std::abs(weight(kRegion) - kWeight), 1e-3);
  EXPECT_EQ(weight({.x0 = 0, .y0 = 0, .x1 = 48, .y1 = 16}), 0.0) << "no face is in the region";
}

// Where two bands with other weights meet, their mean counts.
TEST(DecodedField, BandsHaveTheirOwnWeights) {
  const Leaves leaves;
  const auto soft = leaves.softened(0.4, 0.0);
  const auto density = [&](double y) {
    return soft->density(24 + field::kPixelCentre, y + field::kPixelCentre,
                         3 + field::kPixelCentre);
  };
  EXPECT_NEAR(density(16) - density(14),
              0.6 * (leaves.density(24, 16, 3) - leaves.density(24, 14, 3)), 1e-5);
}

TEST(CodedField, BandsAreTakenOutAndJoinedAgain) {
  const Leaves leaves;
  const CodedField lower = some_bands(leaves.coded, {0, 1}),
                   upper = some_bands(leaves.coded, {1, 2});
  EXPECT_EQ(upper.tree.roots().y0, 16);
  EXPECT_EQ(upper.codes.num_parameters() + lower.codes.num_parameters(),
            leaves.coded.codes.num_parameters());
  const auto alone = decode_field(upper);
  EXPECT_EQ(alone->density(20, 25, 4), leaves.made->density(20, 25, 4));
  CodedField both = lower;
  append(both, upper);
  EXPECT_EQ(both.tree.leaves(), leaves.coded.tree.leaves());
  EXPECT_EQ(both.codes.offset, leaves.coded.codes.offset);
  EXPECT_EQ(both.codes.bytes, leaves.coded.codes.bytes);
  const auto again = decode_field(both);
  EXPECT_TRUE(std::ranges::equal(again->parameters(), leaves.made->parameters()));
}

TEST(DecodedField, CountsWhatTheCodesStandFor) {
  const Leaves leaves;
  std::size_t count = 0;
  for (const LeafShape& shape : leaves.coded.codes.shapes)
    count += field::count_parameters(FieldKind::kVm, {shape});
  EXPECT_EQ(leaves.coded.codes.num_parameters(), count);
  EXPECT_GT(count, 1000u);
}

}  // namespace
}  // namespace tomofield::compact
