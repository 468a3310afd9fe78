#include "report/pictures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "png_picture.h"
#include "scratch_directory.h"

namespace tomofield::report {
namespace {

using Colour = std::array<int, 3>;
constexpr Colour kOrange{255, 140, 0};

// Returns a model of one cell of 64 px in quarters, the upper right one in quarters again. The
// density is a ramp along x. The region of interest starts inside the first leaf.
output::Model stepped_model() {
  field::Quadtree tree({.x0 = 0, .y0 = 0, .cell_size = 64, .columns = 1, .rows = 1},
                       {field::Region::kInterest});
  tree.split(0);
  tree.split(3);
  const field::LeafShape shape{.nx = 2, .ny = 2, .nz = 2};
  output::Model model;
  model.field =
      field::make_field(FieldKind::kGrid, tree, 10.0, std::vector<field::LeafShape>(7, shape));
  for (int leaf = 0; leaf < 7; ++leaf) {
    const field::Square& square = tree.leaf(leaf).square;
    for (std::size_t i = 0; i < 8; ++i)
      model.field->parameters()[model.field->offset(leaf) + i] =
          static_cast<float>(i < 4 ? square.x0 : square.x1());
  }
  model.roi = {4, 8, 64, 60};
  return model;
}

TEST(TreePicture, DrawsLeafBordersOverTheSlice) {
  const testing::ScratchDirectory scratch;
  const std::filesystem::path path = scratch.path() / "tree.png";
  const output::Model model = stepped_model();
  write_tree_picture(model, path);
  const auto picture = testing::read_png(path, PNG_FORMAT_RGB);
  const std::int64_t zoom = 9;  // 60 × 9 is the first multiple past 512
  ASSERT_EQ(picture.width, 60 * zoom);
  ASSERT_EQ(picture.height, 52 * zoom);
  const auto at = [&](double x, double y) {  // pixels of the view
    const auto column = static_cast<std::int64_t>((x - 4) * zoom);
    const auto row = picture.height - 1 - static_cast<std::int64_t>((y - 8) * zoom);
    return Colour{picture.at(column, row, 0), picture.at(column, row, 1),
                  picture.at(column, row, 2)};
  };
  EXPECT_EQ(at(32, 20.5), kOrange);  // between the lower quarters
  EXPECT_EQ(at(10.5, 32), kOrange);  // between the left ones
  EXPECT_EQ(at(48, 40.5), kOrange);  // inside the upper right one
  EXPECT_EQ(at(40.5, 48), kOrange);
  std::set<std::vector<int>> plain;
  for (const auto& [x, y] : {std::pair{48.0, 20.5},
                             {10.5, 48.0},
                             {31.9, 20.5},
                             {32.2, 20.5},
                             {10.5, 31.9},
                             {10.5, 32.2},
                             {4.0, 20.5},
                             {20.5, 8.0}})
    EXPECT_NE(at(x, y), kOrange) << x << ' ' << y;
  // The grey follows the density, which rises along x and is constant along y.
  const Colour left = at(10.5, 20.5), right = at(58.5, 20.5);
  EXPECT_EQ(left[0], left[1]);
  EXPECT_EQ(left[0], left[2]);
  EXPECT_EQ(at(10.5, 50.5), left);
  EXPECT_NEAR(right[0] - left[0], 255.0 * 48 / 60, 6);
}

}  // namespace
}  // namespace tomofield::report
