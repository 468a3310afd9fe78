#include "tilt_series/masks/spot_place.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "tilt_series/masks/mask_metrics.h"

namespace tomofield::tilt_series {
namespace {

// Standard deviation of the Gaussian, in diameters. It is a little narrower than the spot, which is
// best for the place: the flanks of a bead are steep.
constexpr double kWidth = 0.36;
constexpr int kRounds = 4;            // of least squares
constexpr double kMostStep_px = 1.0;  // of a round
constexpr double kFarthest = 0.5;     // from the given place, in diameters
constexpr std::int64_t kFewPixels = 12;

// Columns of the least-squares problem; the Gaussian's derivatives are those by its place.
enum Column { kGround, kSlopeX, kSlopeY, kHeight, kByX, kByY, kColumns };
using Row = Eigen::Matrix<double, kColumns, 1>;
using Normal = Eigen::Matrix<double, kColumns, kColumns>;

Row row_of(double dx, double dy, double width) {
  const double height = std::exp(-(dx * dx + dy * dy) / (2 * width * width));
  Row row;
  row << 1.0, dx, dy, height, height * dx / (width * width), height * dy / (width * width);
  return row;
}

}  // namespace

std::optional<std::array<double, 2>> spot_place(const MaskedImage& image, double x_px, double y_px,
                                                double diameter_px) {
  double x = x_px, y = y_px;
  for (int round = 0; round < kRounds; ++round) {
    Normal normal = Normal::Zero();
    Row right = Row::Zero();
    std::int64_t num_pixels = 0;
    for_pixels_in({x, y, diameter_px}, image.width, image.height,
                  [&](std::int64_t px, std::int64_t py) {
                    const std::size_t at = image.index(px, py);
                    if (!image.valid[at]) return;
                    const Row row = row_of(static_cast<double>(px) + 0.5 - x,
                                           static_cast<double>(py) + 0.5 - y, kWidth * diameter_px);
                    normal += row * row.transpose();
                    right += static_cast<double>(image.values[at]) * row;
                    ++num_pixels;
                  });
    if (num_pixels < kFewPixels) return std::nullopt;
    const Row found = normal.ldlt().solve(right);
    if (!(found[kHeight] > 0.0)) return std::nullopt;
    x += std::clamp(found[kByX] / found[kHeight], -kMostStep_px, kMostStep_px);
    y += std::clamp(found[kByY] / found[kHeight], -kMostStep_px, kMostStep_px);
    if (!(std::hypot(x - x_px, y - y_px) <= kFarthest * diameter_px)) return std::nullopt;
  }
  return std::array{x, y};
}

}  // namespace tomofield::tilt_series
