#include "measurement/patch_errors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace tomofield::measurement {
namespace {

struct Squares {
  double sum = 0;
  std::int64_t count = 0;
};

// Adds up the squared residuals of the measured pixels in columns `begin` to `end`.
Squares squares_of(const PredictedView& view, std::int64_t begin, std::int64_t end) {
  Squares squares;
  for (std::int64_t y = 0; y < view.height; ++y) {
    for (std::int64_t x = begin; x < end; ++x) {
      const auto at = static_cast<std::size_t>(y * view.width + x);
      if (std::isnan(view.measured[at])) continue;
      const double residual =
          static_cast<double>(view.predicted[at]) - static_cast<double>(view.measured[at]);
      squares.sum += residual * residual;
      ++squares.count;
    }
  }
  return squares;
}

}  // namespace

std::vector<double> patch_errors(std::span<const PredictedView> views,
                                 std::span<const double> noise_weight) {
  std::vector<double> errors;
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::int64_t begin = 0; begin < views[v].width; begin += kPatchColumns) {
      const std::int64_t end = std::min(begin + kPatchColumns, views[v].width);
      const Squares squares = squares_of(views[v], begin, end);
      if (2 * squares.count < (end - begin) * views[v].height) continue;
      errors.push_back(noise_weight[v] * squares.sum / static_cast<double>(squares.count));
    }
  }
  return errors;
}

}  // namespace tomofield::measurement
