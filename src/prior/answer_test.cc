#include "prior/answer.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <vector>

#include "base/parallel.h"
#include "random_arrays.h"

namespace tomofield::prior {
namespace {

using testing::random_floats;

constexpr int kSide = 16, kThickness = 12;
constexpr Rectangle kRoi{0, 0, 40, 24};

// Three columns and two rows of leaves of plain vertices, of which a part lies outside of the
// region, and a column of the margin before them.
std::unique_ptr<field::Field> make_vertices(float beta) {
  const field::RootGrid roots{.x0 = -kSide, .y0 = 0, .cell_size = kSide, .columns = 4, .rows = 2};
  std::vector<field::Region> regions;
  for (int cell = 0; cell < 8; ++cell)
    regions.push_back(cell % 4 == 0 ? field::Region::kMargin : field::Region::kInterest);
  std::vector<field::LeafShape> shapes;
  field::Quadtree tree(roots, regions);
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf) {
    const bool is_margin = tree.leaf(leaf).region == field::Region::kMargin;
    const int n = is_margin ? kSide / 2 + 1 : kSide + 1;
    shapes.push_back({.nx = n, .ny = n, .nz = is_margin ? kThickness / 2 : kThickness});
  }
  auto field = make_field(FieldKind::kGrid, std::move(tree), kThickness, std::move(shapes));
  field->initialise(base::Random(3), 1.0);
  field->bias = 0.25f;
  field->activation = {beta};
  return field;
}

double density_at(const field::Field& field, int x, int z, int y) {
  return field.density(x + 0.5, y + 0.5, z + 0.5);
}

TEST(PriorLattice, HasTheDensitiesAtTheCentresOfPixels) {
  for (const float beta : {0.0f, 4.0f}) {
    const auto field = make_vertices(beta);
    const Lattice lattice(*field, kRoi);
    EXPECT_EQ(lattice.shape(), (BoxShape{40, kThickness, 24}));
    const Lattice::Part part{{14, 40}, {2, 9}, {3, 20}};
    std::vector<float> box(part.shape().size());
    lattice.read(field->parameters(), part, box);
    std::size_t next = 0;
    for (int x = part.x.begin; x < part.x.end; ++x) {
      for (int z = part.z.begin; z < part.z.end; ++z) {
        for (int y = part.y.begin; y < part.y.end; ++y, ++next) {
          if (x % kSide == 0 || y % kSide == 0) continue;  // on faces, leaves differ
          ASSERT_NEAR(box[next], density_at(*field, x, z, y), 1e-5) << x << " " << z << " " << y;
        }
      }
    }
  }
}

TEST(PriorLattice, IsMirroredBeyondItsEnds) {
  const auto field = make_vertices(0.0f);
  const Lattice lattice(*field, kRoi);
  const auto value = [&](int x, int z, int y) {
    std::vector<float> one(1);
    lattice.read(field->parameters(), {{x, x + 1}, {z, z + 1}, {y, y + 1}}, one);
    return one[0];
  };
  EXPECT_EQ(value(-3, 5, 7), value(3, 5, 7));
  EXPECT_EQ(value(42, 5, 7), value(36, 5, 7));
  EXPECT_EQ(value(4, -1, 7), value(4, 1, 7));
  EXPECT_EQ(value(4, kThickness + 1, 7), value(4, kThickness - 3, 7));
  EXPECT_EQ(value(4, 5, 24), value(4, 5, 22));
}

TEST(PriorLattice, IsWrittenIntoAllLeavesOfAFace) {
  for (const float beta : {0.0f, 4.0f}) {
    const auto field = make_vertices(beta);
    const Lattice lattice(*field, kRoi);
    const Lattice::Part all{{0, 40}, {0, kThickness}, {0, 24}};
    const std::vector<float> box = random_floats(lattice.shape().size(), 6, 0.1, 1.0);
    lattice.write(box, all, field->parameters());
    for (int x = 0; x < 40; ++x) {
      for (int y = 0; y < 24; ++y) {
        const int z = (x + y) % kThickness;
        const float written = box[static_cast<std::size_t>((x * kThickness + z) * 24 + y)];
        const auto at = [&](double shift) {
          return field->density(x + 0.5 + shift, y + 0.5 + shift, z + 0.5);
        };
        ASSERT_NEAR(written, at(1e-6), 1e-4) << x << " " << y;
        ASSERT_NEAR(written, x > 0 && y > 0 ? at(-1e-6) : written, 1e-4) << x << " " << y;
      }
    }
  }
}

TEST(PriorAnswer, DoesNotDependOnThePartsOfTheLattice) {
  const auto field = make_vertices(0.0f);
  const Lattice lattice(*field, kRoi);
  const std::vector<float> before(field->parameters().begin(), field->parameters().end());
  const std::vector<float> light = random_floats(before.size(), 7);
  std::vector<float> whole = before, in_parts = before;
  replace_by_answer(Network::trained(), lattice, whole, light);
  replace_by_answer(Network::trained(), lattice, in_parts, light, {.x = 12, .z = 8, .y = 8});
  EXPECT_NE(whole, before);
  for (std::size_t i = 0; i < whole.size(); ++i) ASSERT_NEAR(whole[i], in_parts[i], 1e-5) << i;
}

TEST(PriorAnswer, HasTheSameBitsForAnyNumberOfThreads) {
  const auto field = make_vertices(0.0f);
  const Lattice lattice(*field, kRoi);
  const std::vector<float> light = random_floats(field->num_parameters(), 8);
  std::vector<std::vector<float>> answers;
  for (const int threads : {1, 3}) {
    base::set_thread_count(threads);
    answers.emplace_back(field->parameters().begin(), field->parameters().end());
    replace_by_answer(Network::trained(), lattice, answers.back(), light);
  }
  base::set_thread_count(0);
  EXPECT_EQ(answers[0], answers[1]);
}

}  // namespace
}  // namespace tomofield::prior
