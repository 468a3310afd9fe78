#include "prior/answer.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <numeric>
#include <span>
#include <vector>

#include "base/threads/parallel.h"
#include "random_arrays.h"

namespace tomofield::prior {
namespace {

using testing::random_floats;

constexpr int kSide = 16, kThickness = 12;
constexpr Rectangle kRoi{0, 0, 40, 24};

// Three columns and some rows of leaves of plain vertices, of which a part lies outside of the
// region, and a column of the margin before them.
std::unique_ptr<field::Field> make_vertices(float beta, int rows = 2) {
  const field::RootGrid roots{
      .x0 = -kSide, .y0 = 0, .cell_size = kSide, .columns = 4, .rows = rows};
  std::vector<field::Region> regions;
  for (int cell = 0; cell < 4 * rows; ++cell)
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

// Replaces all rows by their answer.
void answer_all(const Lattice& lattice, std::span<float> smooth, std::span<const float> light,
                const PartSize& size = {}) {
  const base::Range all{0, lattice.shape().ny};
  const float mean = mean_density(lattice, all, smooth, distributed::Communicator::alone());
  replace_by_answer(Network::trained(), lattice, {all, mean}, smooth, light, size);
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
  answer_all(lattice, whole, light);
  answer_all(lattice, in_parts, light, {.x = 12, .z = 8, .y = 8});
  EXPECT_NE(whole, before);
  EXPECT_EQ(whole, in_parts);
}

TEST(PriorLattice, KnowsTheRowsOfBands) {
  const auto field = make_vertices(0.0f, 4);
  const Lattice lattice(*field, {0, 0, 40, 56});
  EXPECT_EQ(lattice.rows_of({0, 1}), (base::Range{0, 16}));
  EXPECT_EQ(lattice.rows_of({1, 3}), (base::Range{16, 48}));
  EXPECT_EQ(lattice.rows_of({3, 4}), (base::Range{48, 56}));
}

TEST(PriorAnswer, IsThatOfItsRowsWhateverLiesFarFromThem) {
  const auto field = make_vertices(4.0f, 8);
  const Lattice lattice(*field, {0, 0, 40, 120});
  const std::vector<float> before(field->parameters().begin(), field->parameters().end());
  const std::vector<float> light = random_floats(before.size(), 9);
  std::vector<float> whole = before;
  answer_all(lattice, whole, light);
  const base::Range all{0, 120}, own{48, 64}, replaced{48, 65};
  std::vector<float> smooth = before, light_nearby = light;
  const float mean = mean_density(lattice, all, smooth, distributed::Communicator::alone());
  const auto box_of = [&](base::Range rows, std::span<const float> parameters) {
    const Lattice::Part part{{0, 40}, {0, kThickness}, rows};
    std::vector<float> box(part.shape().size());
    lattice.read(parameters, part, box);
    return box;
  };
  for (const base::Range far : {base::Range{0, 48 - kRowsBeyond}, {64 + kRowsBeyond, 120}}) {
    const Lattice::Part part{{0, 40}, {0, kThickness}, far};
    const std::vector<float> other = random_floats(part.shape().size(), 10, 5.0, 6.0);
    lattice.write(other, part, smooth);
    lattice.write(other, part, light_nearby);
  }
  replace_by_answer(Network::trained(), lattice, {own, mean}, smooth, light_nearby);
  EXPECT_EQ(box_of(replaced, smooth), box_of(replaced, whole));
  for (const base::Range others : {base::Range{20, 48}, {65, 92}})
    EXPECT_EQ(box_of(others, smooth), box_of(others, before));
}

// Sums of a divided lattice are those of its rows, so they add up to the sum of all of them.
TEST(PriorAnswer, TakesTheMeanOfItsRows) {
  const auto field = make_vertices(0.0f);
  const Lattice lattice(*field, kRoi);
  const auto mean_of = [&](base::Range rows) {
    return mean_density(lattice, rows, field->parameters(), distributed::Communicator::alone());
  };
  std::vector<float> box(lattice.shape().size());
  lattice.read(field->parameters(), {{0, 40}, {0, kThickness}, {0, 24}}, box);
  const double sum = std::accumulate(box.begin(), box.end(), 0.0);
  EXPECT_NEAR(mean_of({0, 24}), sum / static_cast<double>(box.size()), 1e-7);
  EXPECT_NEAR(mean_of({0, 16}) + mean_of({16, 24}), mean_of({0, 24}), 1e-7);
}

TEST(PriorAnswer, HasTheSameBitsForAnyNumberOfThreads) {
  const auto field = make_vertices(0.0f);
  const Lattice lattice(*field, kRoi);
  const std::vector<float> light = random_floats(field->num_parameters(), 8);
  std::vector<std::vector<float>> answers;
  for (const int threads : {1, 3}) {
    base::set_thread_count(threads);
    answers.emplace_back(field->parameters().begin(), field->parameters().end());
    answer_all(lattice, answers.back(), light);
  }
  base::set_thread_count(0);
  EXPECT_EQ(answers[0], answers[1]);
}

}  // namespace
}  // namespace tomofield::prior
