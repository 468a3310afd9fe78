#include "tilt_series/masks/bead_fringes.h"

#include "microscope/view_filter.h"
#include "tilt_series/masks/mask_metrics.h"

namespace tomofield::tilt_series {
namespace {

// Least half side of a window, in radii, which shows the background as well.
constexpr double kSurroundings_radii = 4.0;

// Samples of a projected sphere in a pixel, along each axis.
constexpr int kSubpixels = 4;

// The derivative by the radius is a difference over this part of it.
constexpr double kStepOfRadius = 0.04;

// Returns the projection of a sphere, averaged over the pixels of a window from (x0, y0) on.
std::vector<float> projection_of(const Sphere& sphere, const BeadFringes& window) {
  const double middle_x = sphere.x_px - static_cast<double>(window.x0);
  const double middle_y = sphere.y_px - static_cast<double>(window.y0);
  const double square = sphere.radius_px * sphere.radius_px;
  std::vector<float> pixels(static_cast<std::size_t>(window.size * window.size), 0.0f);
  for_pixels_in(
      {middle_x, middle_y, sphere.radius_px + 1.0}, window.size, window.size,
      [&](std::int64_t x, std::int64_t y) {
        double sum = 0.0;
        for (int i = 0; i < kSubpixels * kSubpixels; ++i) {
          const double dx = static_cast<double>(x) + (i % kSubpixels + 0.5) / kSubpixels - middle_x;
          const double dy = static_cast<double>(y) + (i / kSubpixels + 0.5) / kSubpixels - middle_y;
          sum += 2.0 * std::sqrt(std::max(square - dx * dx - dy * dy, 0.0));
        }
        pixels[static_cast<std::size_t>(y * window.size + x)] =
            static_cast<float>(sum / (kSubpixels * kSubpixels));
      });
  return pixels;
}

// Sets the derivatives by the place, from those of the values by the pixel.
void set_derivatives_by_place(BeadFringes& fringes) {
  fringes.by_x.assign(fringes.values.size(), 0.0f);
  fringes.by_y.assign(fringes.values.size(), 0.0f);
  const auto row = static_cast<std::size_t>(fringes.size);
  for (std::size_t i = row + 1; i + row + 1 < fringes.values.size(); ++i) {
    fringes.by_x[i] = (fringes.values[i - 1] - fringes.values[i + 1]) / 2;
    fringes.by_y[i] = (fringes.values[i - row] - fringes.values[i + row]) / 2;
  }
}

}  // namespace

BeadFringes fringes_of(const Sphere& sphere, const microscope::ViewTransfer& transfer,
                       std::int64_t width, std::int64_t height) {
  microscope::ViewTransfer local = transfer;
  local.slope = {.at_centre_A = transfer.slope.at(sphere.x_px - static_cast<double>(width) / 2,
                                                  sphere.y_px - static_cast<double>(height) / 2)};
  BeadFringes fringes;
  fringes.sphere = sphere;
  fringes.outer_px =
      std::max(kSurroundings_radii * sphere.radius_px,
               sphere.radius_px + static_cast<double>(microscope::reach_px(local, 1, 1)));
  const auto half = static_cast<std::int64_t>(std::ceil(fringes.outer_px)) + 1;
  fringes.size = 2 * half;
  fringes.x0 = std::llround(sphere.x_px) - half;
  fringes.y0 = std::llround(sphere.y_px) - half;
  const microscope::ViewFilter filter(fringes.size, fringes.size, local);
  fringes.values = filter.apply(projection_of(sphere, fringes));
  set_derivatives_by_place(fringes);
  Sphere larger = sphere;
  larger.radius_px *= 1.0 + kStepOfRadius;
  fringes.by_radius = filter.apply(projection_of(larger, fringes));
  for (std::size_t i = 0; i < fringes.values.size(); ++i)
    fringes.by_radius[i] = (fringes.by_radius[i] - fringes.values[i]) / float(kStepOfRadius);
  return fringes;
}

}  // namespace tomofield::tilt_series
