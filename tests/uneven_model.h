#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "output/model_file.h"
#include "tomofield/options.h"

namespace tomofield::testing {

/// Returns a model with leaves of 64, 32 and 16 px beside each other, margin cells on both sides,
/// unequal numbers of vertices and ranks, a thickness that is no whole number, a region of interest
/// inside, and random densities of about 0 … 1.
inline output::Model uneven_model(FieldKind kind) {
  using enum field::Region;
  const field::RootGrid roots{.x0 = -60, .y0 = 4, .cell_size = 64, .columns = 4, .rows = 2};
  field::Quadtree tree(roots, {kMargin, kInterest, kInterest, kMargin,  //
                               kMargin, kInterest, kInterest, kMargin});
  tree.split(1);
  tree.split(2);
  std::vector<field::LeafShape> shapes;
  for (int i = 0; i < tree.num_leaves(); ++i) {
    if (tree.leaf(i).region == kMargin) {
      shapes.push_back({.nx = 3, .ny = 4, .nz = 2, .rank_x = 1, .rank_y = 1, .rank_z = 1});
    } else {
      shapes.push_back(
          {.nx = 6 + i % 2, .ny = 5, .nz = 4 + i % 3, .rank_x = 2, .rank_y = 3, .rank_z = 1});
    }
  }
  constexpr double kThickness = 21.5;
  output::Model model;
  model.field = make_field(kind, std::move(tree), kThickness, std::move(shapes));
  model.field->initialise(base::Random(3), 0.8);
  model.field->bias = 0.1f;
  model.field->activation = {3.0f};
  model.geometry = geometry::centred_geometry(130, 140, kThickness, {-60.0, -1.5, 0.0, 59.9});
  model.geometry.hand = -1;
  model.geometry.axis_x += 0.5;
  model.roi = {10, 4, 110, 120};
  model.pixel_size_A = 3.3725;
  model.density_unit = 40.0;
  model.options_json = R"({"input": {"stack": "Ångström.mrc"}})";
  return model;
}

}  // namespace tomofield::testing
