#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "simulate/phantom.h"
#include "simulate/project_phantom.h"
#include "simulate/rasterize.h"

namespace tomofield::simulate {
namespace {

// Returns blobs of many widths in an otherwise empty slab. Two of them are cut off by its faces.
Phantom blobs_in_a_slab() {
  Phantom phantom;
  phantom.shape = {40, 36, 24};
  phantom.is_extended = true;
  phantom.half_width_px = 40.0;
  phantom.blobs = {{.center = {2.3, -4.1, 1.7}, .sigma = 1.2, .peak = 0.8},
                   {.center = {-9.6, 7.2, -6.4}, .sigma = 2.9, .peak = -0.3},
                   {.center = {5.5, 3.9, 10.8}, .sigma = 1.9, .peak = 0.5},
                   {.center = {-3.0, -2.0, 4.0}, .sigma = 9.0, .peak = 0.1},
                   {.center = {14.0, 19.5, 0.0}, .sigma = 3.0, .peak = 0.4}};
  return phantom;
}

// Returns the midpoint sum of density_at() along the part of a ray that lies within the slab.
double quadrature(const Phantom& phantom, const ViewFrame& view, std::int64_t column,
                  std::int64_t row) {
  constexpr int kSteps = 4000;
  const double tilt = view.tilt_deg * std::numbers::pi / 180.0;
  const double u = static_cast<double>(column) + 0.5 - static_cast<double>(view.width) / 2.0 -
                   view.raw_from_aligned.shift_x_px;
  const double y = static_cast<double>(row) + 0.5 - static_cast<double>(view.height) / 2.0 -
                   view.raw_from_aligned.shift_y_px;
  const double length = static_cast<double>(phantom.shape.nz) / std::cos(tilt);
  const double start = -length / 2.0 - u * std::tan(tilt);
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    const double t = start + (i + 0.5) * length / kSteps;
    sum += density_at(phantom, u * std::cos(tilt) - t * std::sin(tilt), y,
                      u * std::sin(tilt) + t * std::cos(tilt));
  }
  return sum * length / kSteps;
}

TEST(Blob, LineIntegralsMatchQuadrature) {
  const Phantom phantom = blobs_in_a_slab();
  for (const double tilt_deg : {0.0, -33.3, 60.0}) {
    const ViewFrame view{.width = 40,
                         .height = 36,
                         .tilt_deg = tilt_deg,
                         .raw_from_aligned = {.shift_x_px = 1.3, .shift_y_px = -0.4}};
    std::vector<float> image(40 * 36);
    project_view(phantom, view, image);
    for (std::int64_t row = 0; row < 36; row += 5) {
      for (std::int64_t column = 0; column < 40; column += 3) {
        EXPECT_NEAR(image[static_cast<std::size_t>(row * 40 + column)],
                    quadrature(phantom, view, column, row), 1e-6)
            << tilt_deg << " " << column << " " << row;
      }
    }
  }
}

TEST(Blob, BandsOfRowsGiveTheSameBits) {
  const Phantom phantom = blobs_in_a_slab();
  const ViewFrame view{
      .width = 40, .height = 36, .tilt_deg = 21.0, .raw_from_aligned = {.shift_y_px = 0.1}};
  std::vector<float> whole(40 * 36), bands(40 * 36);
  project_rows(phantom, view, 0, 36, whole);
  for (std::int64_t row = 0; row < 36; row += 7) {
    const std::int64_t count = std::min<std::int64_t>(7, 36 - row);
    project_rows(phantom, view, row, count,
                 std::span(bands).subspan(static_cast<std::size_t>(row * 40),
                                          static_cast<std::size_t>(count * 40)));
  }
  EXPECT_EQ(whole, bands);
}

TEST(Blob, VoxelsAreTheDensitiesAtTheirCentres) {
  Phantom phantom = blobs_in_a_slab();
  phantom.slab_density = 0.17;
  const base::Volume truth = rasterize(phantom);
  for (std::int64_t z = 0; z < 24; ++z) {
    for (std::int64_t y = 0; y < 36; y += 2) {
      for (std::int64_t x = 0; x < 40; x += 3) {
        const double expected =
            density_at(phantom, static_cast<double>(x) + 0.5 - 20.0,
                       static_cast<double>(y) + 0.5 - 18.0, static_cast<double>(z) + 0.5 - 12.0);
        EXPECT_NEAR(truth.at(x, y, z), expected, 2e-7) << x << " " << y << " " << z;
      }
    }
  }
}

TEST(Blob, NothingIsOutsideTheSlab) {
  const Phantom phantom = blobs_in_a_slab();
  EXPECT_GT(density_at(phantom, 5.5, 3.9, 11.99), 0.3);
  EXPECT_EQ(density_at(phantom, 5.5, 3.9, 12.01), 0.0);
}

}  // namespace
}  // namespace tomofield::simulate
