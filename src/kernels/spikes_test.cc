#include "kernels/spikes.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

#include "kernels/reference/reference_kernels.h"
#include "random_arrays.h"
#include "simd_targets.h"

namespace tomofield::kernels {
namespace {

using testing::for_each_simd_target;
using testing::random_floats;
using testing::to_double;

// A lattice of zeros with some ones.
class Ones {
 public:
  explicit Ones(const LatticeShape& shape) : shape_(shape), values_(shape.size()) {}

  float& at(int x, int y, int z) {
    return values_[(static_cast<std::size_t>(x) * static_cast<std::size_t>(shape_.nz) +
                    static_cast<std::size_t>(z)) *
                       static_cast<std::size_t>(shape_.ny) +
                   static_cast<std::size_t>(y)];
  }
  std::vector<float> limited(int rank = 3) const {
    std::vector<float> values = values_;
    limit_spikes(shape_, rank, values.data());
    return values;
  }
  const std::vector<float>& values() const { return values_; }
  std::vector<float> zeros() const { return std::vector<float>(values_.size()); }

 private:
  LatticeShape shape_;
  std::vector<float> values_;
};

TEST(Spikes, AgreeWithTheReferenceForEveryShape) {
  for_each_simd_target([] {
    for (const LatticeShape& shape :
         {LatticeShape{1, 1, 1}, LatticeShape{2, 2, 2}, LatticeShape{1, 40, 3},
          LatticeShape{4, 33, 5}, LatticeShape{5, 3, 4}, LatticeShape{3, 17, 1}}) {
      for (int rank = 1; rank <= kMostSpikeRank; ++rank) {
        std::vector<float> found = random_floats(shape.size(), 7);
        std::vector<double> expected = to_double(found);
        limit_spikes(shape, rank, found.data());
        reference::limit_spikes(shape, rank, expected.data());
        EXPECT_EQ(to_double(found), expected)
            << shape.nx << " " << shape.ny << " " << shape.nz << ", rank " << rank;
      }
    }
  });
}

TEST(Spikes, OfOneAndOfTwoVerticesGo) {
  Ones single({5, 20, 5}), pair({5, 20, 5});
  single.at(2, 9, 2) = pair.at(2, 9, 2) = pair.at(2, 10, 2) = 1.0f;
  EXPECT_EQ(single.zeros(), single.limited());
  EXPECT_EQ(pair.zeros(), pair.limited());
}

TEST(Spikes, AtAFaceOfTheLatticeGo) {
  Ones at_face({5, 20, 5}), at_edge({5, 20, 5});
  at_face.at(0, 9, 2) = at_edge.at(0, 9, 4) = 1.0f;
  EXPECT_EQ(at_face.zeros(), at_face.limited());
  EXPECT_EQ(at_edge.zeros(), at_edge.limited());
}

TEST(Spikes, OfAHighRankAreThinThreads) {
  Ones thread({6, 20, 6});
  for (int y = 0; y < 20; ++y) thread.at(2, y, 2) = thread.at(3, y, 2) = 1.0f;
  EXPECT_EQ(thread.values(), thread.limited(3));
  EXPECT_EQ(thread.zeros(), thread.limited(8));
}

TEST(Spikes, AreNotSheetsThreadsAndSteps) {
  Ones sheet({6, 20, 6}), thread({6, 20, 6}), step({6, 20, 6});
  for (int a = 0; a < 6; ++a) {
    for (int y = 0; y < 20; ++y) {
      sheet.at(3, y, a) = 1.0f;
      step.at(a, y, 4) = step.at(a, y, 5) = 1.0f;
    }
  }
  for (int y = 0; y < 20; ++y)
    thread.at(2, y, 2) = thread.at(2, y, 3) = thread.at(3, y, 2) = thread.at(3, y, 3) = 1.0f;
  EXPECT_EQ(sheet.values(), sheet.limited());
  EXPECT_EQ(sheet.values(), sheet.limited(8));
  EXPECT_EQ(thread.values(), thread.limited(8));
  EXPECT_EQ(step.values(), step.limited(8));
  EXPECT_EQ(thread.values(), thread.limited());
  EXPECT_EQ(step.values(), step.limited());
}

}  // namespace
}  // namespace tomofield::kernels
