#include "simulate/imaging.h"

#include <gtest/gtest.h>

#include <vector>

namespace tomofield::simulate {
namespace {

TEST(DoseSymmetricOrder, GoesOutwardsOnBothSidesByTurns) {
  const std::vector<double> tilts_deg{-9, -6, -3, 0, 3, 6, 9, 12};
  std::vector<double> ordered;
  for (const std::size_t i : dose_symmetric_order(tilts_deg)) ordered.push_back(tilts_deg[i]);
  EXPECT_EQ(ordered, (std::vector<double>{0, 3, -3, -6, 6, 9, -9, 12}));
}

TEST(DrawDefoci, StayInTheRangeAndFollowTheSeed) {
  Imaging imaging;
  EXPECT_FALSE(draw_defoci(imaging, 1, 3)[0]);
  imaging.defocus = {3.0, 5.0};
  imaging.astigmatism_um = 0.3;
  const auto defoci = draw_defoci(imaging, 1, 50);
  for (const auto& defocus : defoci) {
    EXPECT_NEAR(defocus->u_A - defocus->v_A, 3000, 1e-6);
    EXPECT_GE(defocus->u_A + defocus->v_A, 60000 - 0.2);
    EXPECT_LE(defocus->u_A + defocus->v_A, 100000 + 0.2);
  }
  EXPECT_NE(defoci[0]->u_A, defoci[1]->u_A);
  EXPECT_EQ(draw_defoci(imaging, 1, 50)[7]->u_A, defoci[7]->u_A);
  EXPECT_NE(draw_defoci(imaging, 2, 50)[7]->u_A, defoci[7]->u_A);
}

// Returns an extended specimen with two spheres, of which one crosses the border of a view of 96
// pixels.
Phantom two_spheres() {
  Phantom phantom;
  phantom.shape = {.nx = 96, .ny = 96, .nz = 40};
  phantom.is_extended = true;
  phantom.half_width_px = 48;
  for (const auto& center : {std::array{20.0, 8.0, 3.0}, std::array{-18.0, -46.0, 0.0}})
    phantom.bodies.push_back(make_sphere(center, 6.0, 1.0));
  return phantom;
}

std::vector<float> image_of(const ViewFrame& view, const io::Defocus& defocus) {
  std::vector<float> image(static_cast<std::size_t>(view.width * view.height));
  image_view(two_spheres(), view, {}, defocus, 30, 5.0, image);
  return image;
}

// A recorded view that is turned shows the same as the aligned one, turned: the defocus changes
// across the tilt axis, and the direction of the astigmatism turns with the image.
TEST(ImageView, OfATurnedViewIsTheTurnedView) {
  const ViewFrame aligned{.width = 96, .height = 96, .tilt_deg = 50};
  ViewFrame turned = aligned;
  turned.raw_from_aligned = {0, -1, 1, 0, 0, 0};  // by +90 degrees
  const io::Defocus defocus{42000, 36000, 25, 0}, turned_defocus{42000, 36000, 115, 0};
  const auto a = image_of(aligned, defocus), b = image_of(turned, turned_defocus);
  float largest = 0.0f;
  for (int y = 0; y < 96; ++y)
    for (int x = 0; x < 96; ++x) {
      // (x, y) from the centre goes to (−y, x).
      EXPECT_NEAR(b[x * 96 + (95 - y)], a[y * 96 + x], 2e-3) << x << " " << y;
      largest = std::max(largest, std::abs(a[y * 96 + x] - a[0]));
    }
  EXPECT_GT(largest, 2.0f);
}

TEST(ImageView, DoesNotDependOnWhereTheViewEnds) {
  const ViewFrame small{.width = 96, .height = 96, .tilt_deg = -50};
  const ViewFrame wide{.width = 160, .height = 140, .tilt_deg = -50};
  const io::Defocus defocus{42000, 36000, 25, 0};
  const auto a = image_of(small, defocus), b = image_of(wide, defocus);
  for (int y = 0; y < 96; ++y)
    for (int x = 0; x < 96; ++x) EXPECT_NEAR(a[y * 96 + x], b[(y + 22) * 160 + x + 32], 0.03);
}

}  // namespace
}  // namespace tomofield::simulate
