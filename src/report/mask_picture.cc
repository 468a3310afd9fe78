#include "report/mask_picture.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/percentile.h"
#include "io/png.h"

namespace tomofield::report {
namespace {

constexpr std::int64_t kMinWidth_px = 512;
constexpr std::uint8_t kMaskedRed = 220, kMaskedOther = 60;

std::size_t lowest_tilt(const tilt_series::TiltSeries& series) {
  const auto& views = series.views();
  const auto lowest = std::min_element(views.begin(), views.end(),
                                       [](const tilt_series::View& a, const tilt_series::View& b) {
                                         return std::fabs(a.tilt_deg) < std::fabs(b.tilt_deg);
                                       });
  return static_cast<std::size_t>(lowest - views.begin());
}

/// Returns the greys of an image, the densest black. Masked pixels do not affect the scale.
std::vector<std::uint8_t> grey_values(const std::vector<float>& image,
                                      const std::vector<std::uint8_t>& valid) {
  std::vector<float> measured;
  for (std::size_t i = 0; i < image.size(); ++i)
    if (valid[i]) measured.push_back(image[i]);
  std::vector<std::uint8_t> grey(image.size());
  if (measured.empty()) return grey;
  const double low = base::percentile(measured, 0.5), high = base::percentile(measured, 99.5);
  const double scale = high > low ? 255.0 / (high - low) : 0.0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double dark = std::clamp((high - static_cast<double>(image[i])) * scale, 0.0, 255.0);
    grey[i] = static_cast<std::uint8_t>(std::lround(dark));
  }
  return grey;
}

}  // namespace

void write_mask_picture(const tilt_series::TiltSeries& series, const std::filesystem::path& path) {
  const std::int64_t width = series.width(), height = series.height();
  std::vector<float> image(static_cast<std::size_t>(width * height));
  std::vector<std::uint8_t> valid(image.size());
  series.read_view(lowest_tilt(series), image, valid);
  const std::vector<std::uint8_t> grey = grey_values(image, valid);
  const std::int64_t zoom = std::max<std::int64_t>(1, (kMinWidth_px + width - 1) / width);
  std::vector<std::uint8_t> pixels;
  pixels.reserve(static_cast<std::size_t>(width * height * zoom * zoom * 3));
  for (std::int64_t row = 0; row < height * zoom; ++row) {
    const std::int64_t y = height - 1 - row / zoom;  // the first row is at the bottom
    for (std::int64_t column = 0; column < width * zoom; ++column) {
      const auto at = static_cast<std::size_t>(y * width + column / zoom);
      const std::uint8_t red = valid[at] ? grey[at] : kMaskedRed;
      const std::uint8_t other = valid[at] ? grey[at] : kMaskedOther;
      pixels.insert(pixels.end(), {red, other, other});
    }
  }
  io::write_png_rgb(path, width * zoom, height * zoom, pixels);
}

}  // namespace tomofield::report
