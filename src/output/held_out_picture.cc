#include "output/held_out_picture.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/percentile.h"
#include "io/png.h"

namespace tomofield::output {
namespace {

constexpr std::int64_t kGap = 4;  // white pixels between panels

std::vector<float> residual_of(const measurement::PredictedView& view) {
  std::vector<float> residual(view.measured.size());
  for (std::size_t i = 0; i < residual.size(); ++i)
    residual[i] = view.measured[i] - view.predicted[i];
  return residual;
}

std::uint8_t grey_of(double value, double black, double range) {
  if (!std::isfinite(value) || !(range > 0)) return 0;
  return static_cast<std::uint8_t>(
      std::lround(std::clamp((value - black) / range, 0.0, 1.0) * 255.0));
}

}  // namespace

void write_held_out_picture(const std::filesystem::path& path,
                            const measurement::PredictedView& view) {
  std::vector<float> valid;
  for (const float value : view.measured)
    if (std::isfinite(value)) valid.push_back(value);
  const double black = valid.empty() ? 0.0 : base::percentile(valid, 0.5);
  const double range = valid.empty() ? 0.0 : base::percentile(valid, 99.5) - black;
  const struct {
    std::vector<float> values;
    double black;
  } panels[] = {{view.measured, black}, {view.predicted, black}, {residual_of(view), -range / 2}};

  const std::int64_t width = 3 * view.width + 2 * kGap;
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width * view.height), 255);
  for (std::int64_t panel = 0; panel < 3; ++panel) {
    for (std::int64_t y = 0; y < view.height; ++y) {
      const std::int64_t row = view.height - 1 - y;  // the first row is at the bottom
      for (std::int64_t x = 0; x < view.width; ++x) {
        const auto value =
            static_cast<double>(panels[panel].values[static_cast<std::size_t>(y * view.width + x)]);
        pixels[static_cast<std::size_t>(row * width + panel * (view.width + kGap) + x)] =
            grey_of(value, panels[panel].black, range);
      }
    }
  }
  io::write_png_grey(path, width, view.height, pixels);
}

}  // namespace tomofield::output
