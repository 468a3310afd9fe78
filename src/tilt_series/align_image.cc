#include "tilt_series/align_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "base/check.h"
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

// Says which places of the aligned view are sampled: `step` pixels apart from the first one on,
// which is relative to the view's centre.
struct Lattice {
  double first_x, first_y, step;
};

// Samples a raw image of which the pixel (0, 0) lies at `origin`, both in pixels of the raw image
// from the centre of its first pixel.
MaskedImage sample(const MaskedImage& image, double origin, const Lattice& lattice,
                   const RawFromAligned& transform, const geometry::ViewWarp::Vector& raw_centre,
                   const std::optional<geometry::ViewWarp>& local, MaskedImage out) {
  const double raw_x = raw_centre[0] + transform.shift_x_px - origin;
  const double raw_y = raw_centre[1] + transform.shift_y_px - origin;
  std::optional<MotionMap> motion;
  if (local) motion.emplace(*local);
  const auto source_of = [&](double x, double y) {
    return motion ? motion->source_of(x, y) : geometry::ViewWarp::Vector{x, y};
  };
  base::parallel_for("align view", out.height, [&](std::int64_t y) {
    for (std::int64_t x = 0; x < out.width; ++x) {
      const auto [qx, qy] = source_of(lattice.first_x + lattice.step * static_cast<double>(x),
                                      lattice.first_y + lattice.step * static_cast<double>(y));
      const Taps taps_x = make_taps(transform.m11 * qx + transform.m12 * qy + raw_x, image.width);
      const Taps taps_y = make_taps(transform.m21 * qx + transform.m22 * qy + raw_y, image.height);
      const std::size_t at = out.index(x, y);
      out.valid[at] = interpolate(image, taps_x, taps_y, &out.values[at]);
    }
  });
  return out;
}

// Holds sums of measurements and their number at the places of an image.
struct Sums {
  std::vector<double> values;
  std::vector<int> counts;
};

// Returns the sums over each `bin` neighbours in a row of an image. The first one has only the
// first half of them inside, the last one only the last half.
Sums sums_along_rows(const MaskedImage& image, int bin) {
  const std::int64_t width = image.width, half = bin / 2;
  const auto size = static_cast<std::size_t>((width + 1) * image.height);
  Sums sums{std::vector<double>(size), std::vector<int>(size)};
  std::vector<double> before(static_cast<std::size_t>(width + 1));
  std::vector<int> counted(before.size());
  for (std::int64_t y = 0; y < image.height; ++y) {
    for (std::int64_t x = 0; x < width; ++x) {
      const std::size_t at = image.index(x, y), i = static_cast<std::size_t>(x);
      const bool counts = image.valid[at] != 0;
      before[i + 1] = before[i] + (counts ? static_cast<double>(image.values[at]) : 0.0);
      counted[i + 1] = counted[i] + (counts ? 1 : 0);
    }
    for (std::int64_t x = 0; x <= width; ++x) {
      const auto first = static_cast<std::size_t>(std::max<std::int64_t>(0, x - half));
      const auto end = static_cast<std::size_t>(std::min(width, x + half));
      const auto to = static_cast<std::size_t>(y * (width + 1) + x);
      sums.values[to] = before[end] - before[first];
      sums.counts[to] = counted[end] - counted[first];
    }
  }
  return sums;
}

// Returns the mean over bin × bin pixels around each corner of the pixels of an image.
MaskedImage running_means(const MaskedImage& image, int bin) {
  const Sums rows = sums_along_rows(image, bin);
  MaskedImage means(image.width + 1, image.height + 1);
  const auto width = static_cast<std::size_t>(means.width);
  Sums sums{std::vector<double>(width), std::vector<int>(width)};
  const auto add = [&](std::int64_t y, int sign) {
    if (y < 0 || y >= image.height) return;
    const std::size_t from = static_cast<std::size_t>(y) * width;
    for (std::size_t x = 0; x < width; ++x) {
      sums.values[x] += sign * rows.values[from + x];
      sums.counts[x] += sign * rows.counts[from + x];
    }
  };
  const std::int64_t half = bin / 2;
  for (std::int64_t y = 0; y < half - 1; ++y) add(y, 1);
  for (std::int64_t y = 0; y < means.height; ++y) {
    add(y + half - 1, 1);
    add(y - half - 1, -1);
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t at = means.index(static_cast<std::int64_t>(x), y);
      means.valid[at] = 2 * sums.counts[x] >= bin * bin;
      if (means.valid[at]) means.values[at] = static_cast<float>(sums.values[x] / sums.counts[x]);
    }
  }
  return means;
}

// Returns the place of the centre of an image from the centre of its first pixel.
geometry::ViewWarp::Vector centre_of(std::int64_t width, std::int64_t height) {
  return {0.5 * static_cast<double>(width - 1), 0.5 * static_cast<double>(height - 1)};
}

}  // namespace

MaskedImage align_image(const MaskedImage& raw, const RawFromAligned& transform, std::int64_t width,
                        std::int64_t height, const std::optional<geometry::ViewWarp>& local) {
  const auto [x, y] = centre_of(width, height);
  return sample(raw, 0.0, {-x, -y, 1.0}, transform, centre_of(raw.width, raw.height), local,
                MaskedImage(width, height));
}

MaskedImage align_means(const MaskedImage& raw, const RawFromAligned& transform, std::int64_t width,
                        std::int64_t height, std::int64_t first_row, int bin,
                        const std::optional<geometry::ViewWarp>& local) {
  TOMOFIELD_CHECK(bin > 0 && bin % 2 == 0, "squares around the corners of pixels");
  const auto [x, y] = centre_of(width, height);
  const double inside = 0.5 * (bin - 1);  // the centre of the first wide pixel
  const Lattice lattice{inside - x, static_cast<double>(first_row) + inside - y,
                        static_cast<double>(bin)};
  return sample(running_means(raw, bin), -0.5, lattice, transform, centre_of(raw.width, raw.height),
                local, MaskedImage((width + bin - 1) / bin, (height - first_row + bin - 1) / bin));
}

}  // namespace tomofield::tilt_series
