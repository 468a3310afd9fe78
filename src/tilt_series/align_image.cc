#include "tilt_series/align_image.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "tilt_series/motion_map.h"

namespace tomofield::tilt_series {
namespace {

/// The pixels (up to four) along one axis that a position takes its value from.
struct Taps {
  std::int64_t first = 0;
  int count = 0;
  std::array<double, 4> weights{};
};

/// `position` is in pixel centres: 0 is the centre of the first pixel.
Taps make_taps(double position, std::int64_t size) {
  // Rounding must not cost the outermost pixels of an image that is only shifted.
  constexpr double kRounding = 1e-6;
  const auto last = static_cast<double>(size - 1);
  if (!(position >= -kRounding && position <= last + kRounding)) return {};
  position = std::clamp(position, 0.0, last);
  const auto base = static_cast<std::int64_t>(position);
  const double t = position - static_cast<double>(base);
  if (t < kRounding) return {base, 1, {1.0}};
  if (t > 1.0 - kRounding) return {base + 1, 1, {1.0}};
  if (base == 0 || base + 2 >= size) return {base, 2, {1.0 - t, t}};
  const double t2 = t * t, t3 = t2 * t;
  return {base - 1,
          4,
          {0.5 * (-t3 + 2 * t2 - t), 0.5 * (3 * t3 - 5 * t2 + 2), 0.5 * (-3 * t3 + 4 * t2 + t),
           0.5 * (t3 - t2)}};
}

/// Sets pixel `at` of `out` from the taps; false if one of them is no measurement.
bool interpolate(const MaskedImage& raw, const Taps& x, const Taps& y, float* value) {
  if (x.count == 0 || y.count == 0) return false;
  double sum = 0.0;
  for (int j = 0; j < y.count; ++j) {
    const std::size_t line = raw.index(x.first, y.first + j);
    double row = 0.0;
    for (int i = 0; i < x.count; ++i) {
      const std::size_t at = line + static_cast<std::size_t>(i);
      if (!raw.valid[at]) return false;
      row += x.weights[static_cast<std::size_t>(i)] * raw.values[at];
    }
    sum += y.weights[static_cast<std::size_t>(j)] * row;
  }
  *value = static_cast<float>(sum);
  return true;
}

}  // namespace

MaskedImage align_image(const MaskedImage& raw, const RawFromAligned& transform, std::int64_t width,
                        std::int64_t height, const std::optional<geometry::ViewWarp>& local) {
  MaskedImage out(width, height);
  // Pixel centres: i + 1/2 − N/2 on both sides.
  const double out_x = 0.5 * static_cast<double>(width - 1);
  const double out_y = 0.5 * static_cast<double>(height - 1);
  const double raw_x = 0.5 * static_cast<double>(raw.width - 1) + transform.shift_x_px;
  const double raw_y = 0.5 * static_cast<double>(raw.height - 1) + transform.shift_y_px;
  std::optional<MotionMap> motion;
  if (local) motion.emplace(*local);
  const auto source_of = [&](double x, double y) {
    return motion ? motion->source_of(x, y) : geometry::ViewWarp::Vector{x, y};
  };
  base::parallel_for("align view", height, [&](std::int64_t y) {
    for (std::int64_t x = 0; x < width; ++x) {
      const auto [qx, qy] =
          source_of(static_cast<double>(x) - out_x, static_cast<double>(y) - out_y);
      const Taps taps_x = make_taps(transform.m11 * qx + transform.m12 * qy + raw_x, raw.width);
      const Taps taps_y = make_taps(transform.m21 * qx + transform.m22 * qy + raw_y, raw.height);
      const std::size_t at = out.index(x, y);
      out.valid[at] = interpolate(raw, taps_x, taps_y, &out.values[at]);
    }
  });
  return out;
}

}  // namespace tomofield::tilt_series
