#include "simulate/project_pixels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "base/random.h"
#include "simulate/rasterize.h"

namespace tomofield::simulate {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// Holds hollow ellipsoids, a bead and blobs, of which some stick out of the views.
Phantom small_phantom(bool is_extended) {
  Phantom phantom;
  phantom.shape = {40, 36, 24};
  phantom.is_extended = is_extended;
  phantom.half_width_px = 40.0;
  phantom.slab_density = 0.17;
  Ellipsoid hollow = make_aligned_ellipsoid({3.0, -5.0, 2.0}, {7.0, 5.5, 6.5}, 0.6);
  hollow.q[3] = 0.004;
  hollow.radius = 8.0;
  hollow.ratio = 0.88;
  hollow.inside_density = 0.25;
  phantom.bodies = {hollow, make_aligned_ellipsoid({-16.0, 13.0, -3.0}, {6.0, 8.0, 5.0}, 0.3),
                    make_sphere({9.0, 8.0, 7.5}, 3.0, 5.0)};
  phantom.num_beads = 1;
  phantom.blobs = {{.center = {-8.0, -9.0, 10.8}, .sigma = 1.9, .peak = 0.5},
                   {.center = {2.3, 14.1, 1.7}, .sigma = 1.2, .peak = 0.8},
                   {.center = {14.0, 19.5, 0.0}, .sigma = 3.0, .peak = -0.4}};
  return phantom;
}

// Holds what misaligns a view: p = exp(log_scale) R(rotation) q + shift.
struct Similarity {
  double rotation_deg = 0.0, log_scale = 0.0;
  std::complex<double> shift{};

  std::complex<double> factor() const {
    return std::polar(std::exp(log_scale), rotation_deg * kDegree);
  }
  geometry::RawFromAligned map() const {
    const auto f = factor();
    return {f.real(), -f.imag(), f.imag(), f.real(), shift.real(), shift.imag()};
  }
};

geometry::ViewWarp random_warp(double amplitude) {
  geometry::ViewWarp warp{.width_px = 40.0, .height_px = 36.0};
  base::Random random(8);
  for (auto& node : warp.nodes) node = {amplitude * random.normal(), amplitude * random.normal()};
  return warp;
}

// Returns the midpoint sum of density_at() along the ray through a place of the aligned view.
double quadrature(const Phantom& phantom, double tilt_deg, std::complex<double> q) {
  constexpr double kReach = 60.0, kStep = 0.01;
  const double cosine = std::cos(tilt_deg * kDegree), sine = std::sin(tilt_deg * kDegree);
  double sum = 0.0;
  for (double t = -kReach + kStep / 2.0; t < kReach; t += kStep)
    sum +=
        density_at(phantom, q.real() * cosine - t * sine, q.imag(), q.real() * sine + t * cosine);
  return sum * kStep;
}

std::vector<float> project(const Phantom& phantom, const ViewFrame& view) {
  std::vector<float> image(static_cast<std::size_t>(view.width * view.height));
  project_view(phantom, view, image);
  return image;
}

void expect_quadrature(const Phantom& phantom, double tilt_deg, const Similarity& similarity,
                       const std::optional<geometry::ViewWarp>& warp) {
  const auto image = project(phantom, {.width = 40,
                                       .height = 36,
                                       .tilt_deg = tilt_deg,
                                       .raw_from_aligned = similarity.map(),
                                       .warp = warp});
  for (int row = 0; row < 36; row += 4) {
    for (int column = 1; column < 40; column += 4) {
      const std::complex<double> p(column + 0.5 - 20.0, row + 0.5 - 18.0);
      std::complex<double> q = (p - similarity.shift) / similarity.factor();
      if (warp) {
        const auto d = warp->displacement(q.real(), q.imag());
        q += std::complex<double>(d[0], d[1]);
      }
      // The bead's surface costs the sum up to half a step of its density at either end.
      EXPECT_NEAR(image[static_cast<std::size_t>(row * 40 + column)],
                  quadrature(phantom, tilt_deg, q), 0.06)
          << tilt_deg << " " << column << " " << row;
    }
  }
}

TEST(ProjectPixels, MisalignedViewsMatchQuadrature) {
  const Similarity turned{.rotation_deg = 17.0};
  const Similarity scaled{.log_scale = -0.13, .shift = {1.2, 0.0}};
  const Similarity all{.rotation_deg = -61.0, .log_scale = 0.11, .shift = {-2.4, 3.3}};
  for (const bool is_extended : {false, true}) {
    const Phantom phantom = small_phantom(is_extended);
    expect_quadrature(phantom, 0.0, turned, std::nullopt);
    expect_quadrature(phantom, 40.0, scaled, std::nullopt);
    expect_quadrature(phantom, -55.0, all, std::nullopt);
    expect_quadrature(phantom, 25.0, {}, random_warp(1.5));
    expect_quadrature(phantom, -55.0, all, random_warp(1.5));
  }
}

// Blobs alone are smooth, so that the sums are exact.
TEST(ProjectPixels, BlobsMatchQuadratureClosely) {
  Phantom phantom = small_phantom(true);
  phantom.bodies.clear();
  phantom.num_beads = 0;
  phantom.slab_density = 0.0;
  const Similarity similarity{.rotation_deg = 33.0, .log_scale = 0.2, .shift = {-2.4, 3.3}};
  const ViewFrame view{.width = 40,
                       .height = 36,
                       .tilt_deg = 30.0,
                       .raw_from_aligned = similarity.map(),
                       .warp = std::nullopt};
  const auto image = project(phantom, view);
  const float largest = *std::max_element(image.begin(), image.end());
  EXPECT_GT(largest, 1.0f);
  for (int row = 0; row < 36; row += 3) {
    for (int column = 0; column < 40; column += 3) {
      const std::complex<double> p(column + 0.5 - 20.0, row + 0.5 - 18.0);
      EXPECT_NEAR(image[static_cast<std::size_t>(row * 40 + column)],
                  quadrature(phantom, 30.0, (p - similarity.shift) / similarity.factor()), 2e-3);
    }
  }
}

TEST(ProjectPixels, AQuarterTurnIsATurnedImage) {
  const Phantom phantom = small_phantom(true);
  ViewFrame view{.width = 38, .height = 38, .tilt_deg = 20.0};
  const auto plain = project(phantom, view);
  view.raw_from_aligned = {.m11 = 0.0, .m12 = -1.0, .m21 = 1.0, .m22 = 0.0};
  const auto turned = project(phantom, view);
  for (std::size_t row = 0; row < 38; ++row) {
    for (std::size_t column = 0; column < 38; ++column)
      EXPECT_NEAR(turned[row * 38 + column], plain[(37 - column) * 38 + row], 1e-5);
  }
}

// A warp without displacement takes the way of single pixels.
TEST(ProjectPixels, PixelsAgreeWithRows) {
  for (const bool is_extended : {false, true}) {
    const Phantom phantom = small_phantom(is_extended);
    ViewFrame view{.width = 40,
                   .height = 36,
                   .tilt_deg = -33.0,
                   .raw_from_aligned = {.shift_x_px = 1.3, .shift_y_px = -2.6}};
    const auto rows = project(phantom, view);
    view.warp = geometry::ViewWarp{.width_px = 40.0, .height_px = 36.0};
    const auto pixels = project(phantom, view);
    for (std::size_t pixel = 0; pixel < rows.size(); ++pixel)
      EXPECT_NEAR(pixels[pixel], rows[pixel], 1e-5) << pixel;
  }
}

TEST(ProjectPixels, BandsOfRowsGiveTheSameBits) {
  const Phantom phantom = small_phantom(true);
  const Similarity similarity{.rotation_deg = 9.0, .log_scale = 0.02, .shift = {-2.4, 3.3}};
  const ViewFrame view{.width = 40,
                       .height = 36,
                       .tilt_deg = 21.0,
                       .raw_from_aligned = similarity.map(),
                       .warp = random_warp(1.0)};
  const auto whole = project(phantom, view);
  std::vector<float> bands(whole.size());
  for (std::int64_t row = 0; row < 36; row += 7) {
    const std::int64_t count = std::min<std::int64_t>(7, 36 - row);
    project_rows(phantom, view, row, count,
                 std::span(bands).subspan(static_cast<std::size_t>(row * 40),
                                          static_cast<std::size_t>(count * 40)));
  }
  EXPECT_EQ(whole, bands);
}

}  // namespace
}  // namespace tomofield::simulate
