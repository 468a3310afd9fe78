#include "fit/domain.h"

#include <gtest/gtest.h>

namespace tomofield::fit {
namespace {

using field::LeafShape;
using field::Region;

Domain domain_of(double spacing, double margin_spacing) {
  geometry::TiltGeometry geometry;
  geometry.width = 128;
  geometry.height = 64;
  geometry.thickness = 75;
  geometry.tilt_deg = {-60, 0, 60};
  geometry.axis_x = 64;
  geometry.axis_z = 37.5;
  FieldOptions options;
  options.leaf_size = 64;
  options.vertex_spacing = spacing;
  options.margin_spacing = margin_spacing;
  return make_domain(geometry, {0, 0, 128, 64}, options);
}

TEST(Domain, ACoarseStageHasEveryOtherVertexOfTheUsualField) {
  const Domain domain = domain_of(1, 2);
  for (const Region region : {Region::kInterest, Region::kMargin}) {
    const LeafShape full = domain.shape_in(region, 1), coarse = domain.shape_in(region, 2);
    EXPECT_EQ(coarse.nx, (full.nx - 1) / 2 + 1);
    EXPECT_EQ(coarse.ny, (full.ny - 1) / 2 + 1);
    EXPECT_NEAR(coarse.nz, (full.nz - 1) / 2.0 + 1, 0.5);
    EXPECT_EQ(coarse.rank_x, full.rank_x);
  }
  EXPECT_EQ(domain.shape_in(Region::kInterest, 256).nx, 2);
}

TEST(Domain, ACoarseStageKeepsVerticesThatItsPixelsResolve) {
  const Domain domain = domain_of(2.5, 8);
  for (const Region region : {Region::kInterest, Region::kMargin})
    EXPECT_EQ(domain.shape_in(region, 2), domain.shape_in(region, 1));
  EXPECT_EQ(domain.shape_in(Region::kInterest, 4).nx, 17);  // 2.5 to 4 pixels
  EXPECT_EQ(domain.coarsening(Region::kMargin, 8), 2);      // 8 to 16 pixels
}

TEST(Domain, SamplesOfACoarseMarginAreAsFarApartAsItsVertices) {
  for (const double spacing : {2.0, 4.0, 8.0}) {
    const Domain domain = domain_of(1, spacing);
    for (const int bin : {2, 4}) {
      const projection::SampleGrid grid = sample_grid(domain, 75, bin);
      const double in_view_pixels = grid.segments().back().hx * bin;
      EXPECT_DOUBLE_EQ(in_view_pixels, spacing * domain.coarsening(Region::kMargin, bin));
    }
  }
}

}  // namespace
}  // namespace tomofield::fit
